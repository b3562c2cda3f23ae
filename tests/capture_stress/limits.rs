//! What each technique may be off by, and why. A technique that is not here fails every test.

use antumbra::shadow::Technique;

/// Limits of one technique. Parts are of the pixels that can be compared.
pub struct Limits {
    /// What one sample more or less changes a pixel by.
    pub step: f32,
    /// Part of pixels off under a light of no size, in cases of shadows finer than a texel.
    pub fine: f64,
    /// Part of pixels of an empty, closed room that are not fully lit.
    pub own_walls: f64,
    /// Root mean square change of partly lit pixels when scene, light and camera turn together.
    pub turned: f64,
    /// Change of the mean of all pixels then.
    pub turned_mean: f64,
    /// Part of pixels that one blocker more brightens by more than a step.
    pub brighter: f64,
    /// Part of pixels that a small move of light or camera changes by more than `jump`.
    pub jumps: f64,
    /// A change that counts as a jump.
    pub jump: f32,
    /// Part of pixels that rounding may decide anew under a uniform scale or far away.
    pub flips: f64,
}

/// Part of the pixels that rounding may decide anew.
pub const MAY_FLIP: f64 = 0.0005;

pub fn limits(technique: Technique) -> Limits {
    match technique.name() {
        // One ray decides a pixel. Triangles narrower than a texel are found by depths alone, so an
        // edge may be off by a texel there, and where it lies depends on the grid of the map.
        "hard" => Limits {
            step: 1.0,
            fine: 0.005,
            own_walls: 0.0,
            turned: 1.0,
            turned_mean: 0.002,
            brighter: 0.0005,
            jumps: 0.002,
            jump: 0.5,
            flips: MAY_FLIP,
        },
        // The filter reaches 2.5 texels whatever the light: shadows narrower than that blur away. Its
        // taps fall on other texels once the map is fitted anew (boxes lie along the axes, so a turn
        // changes the fit): an edge is up to 0.71 texels off in either map, 1.42 of the 5 that the
        // filter is wide, at the slope of a disk's area, 4 / pi: 0.36. With the fit fixed a texel can
        // only get nearer to the light. Rounding may decide a tap: one, of one of 1269 pixels.
        "pcf" => Limits {
            step: 1.0 / 32.0,
            fine: 0.06,
            own_walls: 0.0,
            turned: 0.36,
            turned_mean: 0.002,
            brighter: 0.0,
            jumps: 0.005,
            jump: 0.25,
            flips: 0.001,
        },
        // As pcf where the filter is narrow. The area searched for blockers follows boxes along the
        // axes, so a turn changes what is found: a fault of the method, measured as 0.35 and, of the
        // whole picture, 0.025 under a grazing light. Near concave edges the neighbouring wall is in front
        // of the receiver's plane, which is taken to go on. A blocker more changes the mean distance
        // of blockers, and with it the width of every filter that finds it: 4.5 % of pixels
        // at most, by 0.28 at most.
        "pcss" => Limits {
            step: 1.0 / 32.0,
            fine: 0.01,
            own_walls: 0.002,
            turned: 0.4,
            turned_mean: 0.03,
            brighter: 0.06,
            jumps: 0.005,
            jump: 0.25,
            flips: MAY_FLIP,
        },
        // No map but that of the line's centre decides anything, and edges are where triangles have them, whatever
        // the guise: no pixel changes by a thousandth. Edges that share a 32nd of the line are the step.
        "oess" => Limits {
            step: 1.0 / 32.0,
            fine: 0.005,
            own_walls: 0.0,
            turned: 0.01,
            turned_mean: 0.001,
            brighter: 0.0,
            jumps: 0.005,
            jump: 0.25,
            flips: MAY_FLIP,
        },
        // Measured at these pictures' 512 texels: boxes that turn with the scene fit nearly the same
        // views, and the rest is where texels and slices fall on edges; most under a light that its
        // blockers touch, where kernels are larger than the view (`grazing`: 0.046, and 0.014 of the
        // picture). Beside the walls of a room the slice that holds them cannot tell them from blockers.
        // A bit that rounding sets changes what its kernels find: up to 28 of 4096 pixels, by up to
        // 0.007.
        "occlusion-textures" => Limits {
            step: 1.0 / 32.0,
            fine: 0.001,
            own_walls: 0.002,
            turned: 0.05,
            turned_mean: 0.015,
            brighter: 0.0005,
            jumps: 0.001,
            jump: 0.25,
            flips: 0.007,
        },
        // No map but that of the light's centre decides anything, and edges are where triangles have them,
        // whatever the guise; that map misses what is smaller than a texel where no edge is before the
        // light. Where a blocker cuts through the light 32 rays decide, and their places on it are
        // not mirrored with it: 0.033, and 0.0012 of the picture. Where blockers overlap, samples correct
        // what edges know, so that one more of them may brighten a pixel by more than one sample does:
        // eight of 3738, by up to 0.049.
        "dbuffer" => Limits {
            step: 1.0 / 32.0,
            fine: 0.001,
            own_walls: 0.0,
            turned: 0.04,
            turned_mean: 0.002,
            brighter: 0.0025,
            jumps: 0.001,
            jump: 0.25,
            flips: MAY_FLIP,
        },
        // Masks are those of rays, whatever the guise. The places of the samples are not mirrored with the
        // scene: 0.034, and 0.0021 of the picture under a light larger than the scene. One blocker more
        // changes which tiles get more samples: 21 of 3738 pixels are brighter by more than one of 64
        // samples then, by up to 0.07; with as many samples everywhere none is.
        // Of a light that a blocker cuts nearly all pixels are partly lit, most of them with 256 samples: rounding
        // decides eight of 800,000 anew, in as many of 3125 pixels.
        "shaft-masks" => Limits {
            step: 1.0 / 64.0,
            fine: 0.001,
            own_walls: 0.0,
            turned: 0.04,
            turned_mean: 0.003,
            brighter: 0.007,
            jumps: 0.001,
            jump: 0.25,
            flips: 0.003,
        },
        // Texels lie elsewhere once the scene is turned: 0.075 under a grazing light, whose texels stretch
        // over many pixels. A blocker a millimetre from the light is cut off where it is nearer than a 64th
        // of the light's reach: 0.008 of the picture. A centimetre in a view of kilometres is less than a texel. Four
        // pixels of 2922 see one ray more or less of a scaled scene.
        "mdi" => Limits {
            step: 1.0 / 64.0,
            fine: 0.006,
            own_walls: 0.0,
            turned: 0.08,
            turned_mean: 0.01,
            brighter: 0.0005,
            jumps: 0.001,
            jump: 0.25,
            flips: 0.0015,
        },
        // Each of 13 places on the light is looked up in the maps, so that a step is a thirteenth. Rounding
        // moves some of them to another texel, and with it to another edge: in a hundred scraps of paper 144 of 2542
        // pixels change, by up to 0.08. A texel holds one edge: those of a wire that crosses a wider blocker
        // push the blocker's out, and 104 of 3738 pixels get brighter by up to 0.17.
        "ssoc" => Limits {
            step: 1.0 / 13.0,
            fine: 0.005,
            own_walls: 0.0,
            turned: 0.2,
            turned_mean: 0.002,
            brighter: 0.03,
            jumps: 0.005,
            jump: 0.25,
            flips: 0.06,
        },
        other => panic!("state the limits of technique `{other}` in {}", file!()),
    }
}

/// The most light that a technique lets out of a closed mesh. A surface that leans across the slices of
/// `occlusion-textures` leaves a little between one slice's part of it and the next one's; where two cracks
/// that rounding has left in a mesh meet, `ssoc` takes a few of their edges for outlines (19 of 4096 pixels).
pub fn leak(technique: Technique) -> f32 {
    match technique.name() {
        "occlusion-textures" => 0.035,
        // Between two boundaries a ray passes texels that it is not tested in: 0.11 measured. `sides=on`
        // stops that and darkens penumbrae.
        "mdi" => 0.12,
        "ssoc" => 0.04,
        _ => 0.0,
    }
}

/// All techniques.
///
/// The relations are asked on Mesa, cases by themselves on SwiftShader too. Of the relations SwiftShader, with a
/// sixteenth of the sub-texel steps, breaks some: `pcss` in `far-and-near` turned (59 of 3215 pixels),
/// `occlusion-textures` in `shut-in` scaled (100 of 4096, by up to 0.01), and `oess` in `cage`, where a line lies
/// within a mesh with dozens of holes and edges beside the line come and go (mean changes of up to 0.06).
///
/// What `auto` chooses is among them. With `ANTUMBRA_TEST_TECHNIQUE` only the one that it names.
pub fn techniques() -> impl Iterator<Item = Technique> {
    let one = std::env::var("ANTUMBRA_TEST_TECHNIQUE").ok();
    let all = Technique::ALL.iter().copied();
    all.filter(move |technique| match &one {
        Some(name) => technique.name() == name,
        None => !matches!(technique, Technique::Auto(_)),
    })
}

/// Whether frames of a technique take milliseconds; those of the others take up to a second on some drivers.
pub fn is_quick(technique: Technique) -> bool {
    !["mdi", "shaft-masks"].contains(&technique.name())
}

/// Fails on any fault.
#[track_caller]
pub fn judge(faults: &[String]) {
    assert!(faults.is_empty(), "{faults:#?}");
}
