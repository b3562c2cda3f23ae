//! Keyframes: from a moment to the transforms and morph weights of animated nodes.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DQuat, DVec3};
use gltf::Document;
use gltf::json::animation::{Channel, Interpolation, Property, Sampler};
use gltf::json::validation::Checked;

use super::accessor::Accessors;
use super::nodes::{Parts, Tree, unit_rotation};
use super::{SceneError, element};

/// What animation changes at one moment. Nodes that are not in it are as the file has them.
#[derive(Debug, Default)]
pub(super) struct Pose {
    pub(super) parts: BTreeMap<usize, Parts>,
    /// One for each morph target.
    pub(super) weights: BTreeMap<usize, Vec<f64>>,
}

/// All animations of a file, at once.
#[derive(Debug, Default)]
pub(super) struct Animation {
    tracks: Vec<Track>,
}

/// The course of one property of one node.
#[derive(Debug)]
struct Track {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    /// Seconds, finite, none smaller than the one before; at least one.
    times: Vec<f32>,
    /// For each time one value of `width` numbers; for splines the tangent into the key, the value
    /// and the tangent out of it.
    values: Vec<f32>,
    width: usize,
}

impl Animation {
    /// Reads all channels in document order. Of those with the same node and property the first one
    /// counts.
    pub(super) fn read(
        accessors: &Accessors<'_>,
        document: &Document,
        tree: &Tree,
    ) -> Result<Self, SceneError> {
        let source = accessors.source;
        let mut tracks = Vec::new();
        let mut taken = BTreeSet::new();
        for (index, animation) in document.as_json().animations.iter().enumerate() {
            for (number, channel) in animation.channels.iter().enumerate() {
                let name = format!(
                    "{}, channel {number}",
                    element("animation", index, animation.name.as_deref())
                );
                let invalid = |reason: String| source.invalid(name.clone(), reason);
                let sampler = (animation.samplers.get(channel.sampler.value()))
                    .ok_or_else(|| invalid("its sampler is missing".into()))?;
                let (node, property) = target(document, tree, channel).map_err(&invalid)?;
                if !taken.insert((node, property as u8)) {
                    log::debug!("{}: {name}: an earlier channel counts", source.label());
                    continue;
                }
                let width = match property {
                    Property::Translation | Property::Scale => 3,
                    Property::Rotation => 4,
                    Property::MorphTargetWeights => target_count(document, node),
                };
                if width == 0 {
                    log::warn!("{}: {name}: no morph targets there", source.label());
                    continue;
                }
                let track = Track::read(accessors, document, sampler, node, property, width);
                tracks.push(track?.map_err(invalid)?);
            }
        }
        Ok(Self { tracks })
    }

    pub(super) fn is_empty(&self) -> bool {
        self.tracks.is_empty()
    }

    /// The last key's time in seconds, at least 0.
    pub(super) fn duration(&self) -> f64 {
        let ends = self.tracks.iter().filter_map(|track| track.times.last());
        ends.fold(0.0, |longest: f64, &end| longest.max(f64::from(end)))
    }

    /// What is animated, `seconds` after the start. NaN is the start.
    pub(super) fn pose(&self, tree: &Tree, seconds: f64) -> Pose {
        let seconds = if seconds.is_nan() { 0.0 } else { seconds };
        let mut pose = Pose::default();
        let mut values = Vec::new();
        for track in &self.tracks {
            track.sample(seconds, &mut values);
            if track.property == Property::MorphTargetWeights {
                pose.weights.insert(track.node, values.clone());
                continue;
            }
            let Some(rest) = tree.parts(track.node) else {
                continue;
            };
            let parts = pose.parts.entry(track.node).or_insert(rest);
            match (track.property, values.as_slice()) {
                (Property::Translation, &[x, y, z]) => parts.translation = DVec3::new(x, y, z),
                (Property::Scale, &[x, y, z]) => parts.scale = DVec3::new(x, y, z),
                (Property::Rotation, &[x, y, z, w]) => {
                    parts.rotation = DQuat::from_xyzw(x, y, z, w);
                }
                _ => {}
            }
        }
        pose
    }
}

/// The node and the property that a channel changes.
fn target(
    document: &Document,
    tree: &Tree,
    channel: &Channel,
) -> Result<(usize, Property), String> {
    let node = channel.target.node.value();
    if node >= document.as_json().nodes.len() {
        return Err(format!("it names node {node}, which is missing"));
    }
    let Checked::Valid(property) = channel.target.path else {
        return Err("its path is none of `translation`, `rotation`, `scale` and `weights`".into());
    };
    if property != Property::MorphTargetWeights && tree.parts(node).is_none() {
        return Err(format!(
            "it moves node {node}, which has a `matrix`; give it translation, rotation and scale"
        ));
    }
    Ok((node, property))
}

/// Number of morph targets of the mesh in `node`.
fn target_count(document: &Document, node: usize) -> usize {
    let json = document.as_json();
    let mesh = json.nodes.get(node).and_then(|node| node.mesh);
    mesh.and_then(|mesh| json.meshes.get(mesh.value())?.primitives.first())
        .and_then(|primitive| primitive.targets.as_ref())
        .map_or(0, Vec::len)
}

impl Track {
    /// The outer error comes from an accessor, the inner one is what is wrong with the channel.
    fn read(
        accessors: &Accessors<'_>,
        document: &Document,
        sampler: &Sampler,
        node: usize,
        property: Property,
        width: usize,
    ) -> Result<Result<Self, String>, SceneError> {
        let accessor = |index: usize| document.accessors().nth(index);
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Ok(Err("its interpolation is unknown".into()));
        };
        let (Some(input), Some(output)) = (
            accessor(sampler.input.value()),
            accessor(sampler.output.value()),
        ) else {
            return Ok(Err("an accessor of its sampler is missing".into()));
        };
        let times = accessors.read_vectors::<1>(&input)?.into_flattened();
        let values = match property {
            Property::Translation | Property::Scale => {
                accessors.read_vectors::<3>(&output)?.into_flattened()
            }
            Property::Rotation => accessors.read_vectors::<4>(&output)?.into_flattened(),
            Property::MorphTargetWeights => accessors.read_vectors::<1>(&output)?.into_flattened(),
        };
        let track = Self {
            node,
            property,
            interpolation,
            times,
            values,
            width,
        };
        Ok(track.checked())
    }

    fn checked(mut self) -> Result<Self, String> {
        if self.times.is_empty() {
            return Err("it has no keys".into());
        }
        if let Some(key) = self.times.iter().position(|time| !time.is_finite()) {
            return Err(format!("the time of key {key} is not finite"));
        }
        if let Some(key) = self.times.windows(2).position(|pair| pair[1] < pair[0]) {
            return Err(format!(
                "key {} comes before key {key}: {} s after {} s",
                key + 1,
                self.times[key + 1],
                self.times[key]
            ));
        }
        let wanted = (self.times.len()).saturating_mul(self.width * self.values_per_key());
        if self.values.len() != wanted {
            return Err(format!(
                "{} keys need {wanted} numbers as output, and it has {}",
                self.times.len(),
                self.values.len()
            ));
        }
        if let Some(at) = self.values.iter().position(|value| !value.is_finite()) {
            let key = at / (self.width * self.values_per_key());
            return Err(format!("a value of key {key} is not finite"));
        }
        if self.property == Property::Rotation {
            for key in 0..self.times.len() {
                let start = self.start(key);
                let rotation = rotation(&self.values[start..start + 4])
                    .ok_or_else(|| format!("the rotation of key {key} is no unit quaternion"))?;
                for (value, unit) in self.values[start..].iter_mut().zip(rotation.to_array()) {
                    *value = unit as f32;
                }
            }
        }
        Ok(self)
    }

    fn values_per_key(&self) -> usize {
        match self.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        }
    }

    /// Where the value of a key begins in `values`.
    fn start(&self, key: usize) -> usize {
        match self.interpolation {
            Interpolation::CubicSpline => (3 * key + 1) * self.width,
            Interpolation::Linear | Interpolation::Step => key * self.width,
        }
    }

    /// The value at `seconds`: `width` numbers, all finite; a rotation is of length 1.
    fn sample(&self, seconds: f64, result: &mut Vec<f64>) {
        result.clear();
        let next = (self.times).partition_point(|&time| f64::from(time) <= seconds);
        let last = self.times.len() - 1;
        let key = next.saturating_sub(1);
        let value = |key: usize| {
            let start = self.start(key);
            &self.values[start..start + self.width]
        };
        let is_rotation = self.property == Property::Rotation;
        if next == 0 || next > last || self.interpolation == Interpolation::Step {
            result.extend(value(key).iter().map(|&x| f64::from(x)));
        } else {
            let (start, end) = (f64::from(self.times[key]), f64::from(self.times[next]));
            let length = end - start;
            let part = (seconds - start) / length;
            let (from, to) = (value(key), value(next));
            if self.interpolation == Interpolation::CubicSpline {
                // glTF 2.0, appendix C: the tangent out of the first key, that into the second.
                let out = &self.values[self.start(key) + self.width..];
                let into = &self.values[self.start(next) - self.width..];
                let (s, s2, s3) = (part, part * part, part * part * part);
                result.extend((0..self.width).map(|i| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * f64::from(from[i])
                        + length * (s3 - 2.0 * s2 + s) * f64::from(out[i])
                        + (3.0 * s2 - 2.0 * s3) * f64::from(to[i])
                        + length * (s3 - s2) * f64::from(into[i])
                }));
            } else if let (true, Some(from), Some(to)) = (is_rotation, rotation(from), rotation(to))
            {
                // Takes the shorter way round.
                result.extend(from.slerp(to, part).to_array());
            } else {
                let mix = |(&from, &to)| f64::from(from) * (1.0 - part) + f64::from(to) * part;
                result.extend(from.iter().zip(to).map(mix));
            }
        }
        if is_rotation {
            let length = result.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 1.0e-9 && length.is_finite() {
                result.iter_mut().for_each(|x| *x /= length);
            } else {
                // A spline through nothing: some rotation, and the same one each time.
                result.clear();
                result.extend(value(key).iter().map(|&x| f64::from(x)));
            }
        }
    }
}

fn rotation(xyzw: &[f32]) -> Option<DQuat> {
    match *xyzw {
        [x, y, z, w] => unit_rotation([x, y, z, w].map(f64::from)),
        _ => None,
    }
}
