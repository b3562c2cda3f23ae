//! Mistakes in the declaration of a graph. Each names the pass and the resource.

/// Why a graph cannot be compiled.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// An id of another graph.
    #[error("pass `{pass}` uses an id of another graph; ids live only as long as their graph")]
    ForeignId {
        /// The pass.
        pass: String,
    },
    /// An id that an earlier write replaced.
    #[error(
        "pass `{pass}` uses `{resource}` version {version}, but `{writer}` wrote version {newer}; use the id that this write returned"
    )]
    StaleId {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// Version that was asked for.
        version: u32,
        /// The pass that wrote the newer version.
        writer: String,
        /// The newest version.
        newer: u32,
    },
    /// An access that an image, or a buffer, cannot have.
    #[error("pass `{pass}`: `{resource}` is {what} and cannot be accessed as {access}")]
    WrongKind {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// "an image" or "a buffer".
        what: &'static str,
        /// The access.
        access: String,
    },
    /// A reading access given to `write`, or the reverse.
    #[error("pass `{pass}`: {access} of `{resource}` {problem}")]
    WrongDirection {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// The access.
        access: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// An access that this kind of pass has no stage for.
    #[error("pass `{pass}` is a {kind} pass and cannot access `{resource}` as {access}")]
    WrongPassKind {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// Kind of pass.
        kind: &'static str,
        /// The access.
        access: String,
    },
    /// A part outside its resource, or an empty one.
    #[error("pass `{pass}`: {part} is outside `{resource}` ({extent})")]
    OutOfRange {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// The part.
        part: String,
        /// What there is.
        extent: String,
    },
    /// Two accesses of one pass that cannot hold at once.
    #[error("pass `{pass}` accesses {part} of `{resource}` both as {first} and as {second}")]
    Conflict {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// The part they share.
        part: String,
        /// One access.
        first: String,
        /// The other access.
        second: String,
    },
    /// A read of what no pass wrote.
    #[error("pass `{pass}` reads {part} of `{resource}`, which no pass before it wrote")]
    ReadBeforeWrite {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// The unwritten part.
        part: String,
    },
    /// A write to what the last frame left.
    #[error("pass `{pass}` writes `{resource}`, which is what the last frame left and read-only")]
    ReadOnly {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
    },
    /// A description that no device can make.
    #[error("`{resource}`: {problem}")]
    BadDescription {
        /// The resource.
        resource: String,
        /// What is wrong.
        problem: String,
    },
    /// An import lacks a usage flag.
    #[error("`{resource}` was imported without usage {missing}, which pass `{pass}` needs")]
    MissingUsage {
        /// The pass.
        pass: String,
        /// The resource.
        resource: String,
        /// Missing flag.
        missing: String,
    },
    /// Attachments of one pass that differ in size.
    #[error(
        "pass `{pass}`: attachment `{resource}` is {width}x{height}, but `{other}` is {other_width}x{other_height}"
    )]
    AttachmentSize {
        /// The pass.
        pass: String,
        /// The attachment.
        resource: String,
        /// Its width in texels.
        width: u32,
        /// Its height in texels.
        height: u32,
        /// The first attachment.
        other: String,
        /// Its width in texels.
        other_width: u32,
        /// Its height in texels.
        other_height: u32,
    },
    /// Two history images under one key.
    #[error("history image `{key}` is declared twice in one graph")]
    DuplicateHistory {
        /// The key.
        key: String,
    },
}
