//! `oess` against rays cast in double precision: lines of any length and direction, near and far, above and beside.

mod support;

use antumbra::light::{AreaLight, LightShape};
use antumbra::scene::{Primitive, Scene};
use glam::{DVec3, Vec3};
use support::plates::{SIZE, camera, floor, floor_x, plate, quad, scene};
use support::rig::render;

/// Places on a line that truth is found at.
const PLACES: u32 = 500;

struct Line {
    name: &'static str,
    center: [f32; 3],
    along: [f32; 3],
    length: f32,
}

fn triangles(scene: &Scene) -> Vec<[DVec3; 3]> {
    let of = |primitive: &Primitive| {
        let corners = primitive.indices.chunks_exact(3);
        let corners =
            corners.map(|c| [0, 1, 2].map(|i| primitive.positions[c[i] as usize].as_dvec3()));
        corners.collect::<Vec<_>>()
    };
    scene.primitives.iter().flat_map(of).collect()
}

/// Whether a triangle is between two points.
fn is_between([a, b, c]: [DVec3; 3], from: DVec3, to: DVec3) -> bool {
    let n = (b - a).cross(c - a);
    let (start, end) = (n.dot(from - a), n.dot(to - a));
    if (start > 0.0) == (end > 0.0) || start.abs() < 1.0e-9 {
        return false;
    }
    let p = from + (to - from) * (start / (start - end));
    let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| n.dot((b - a).cross(p - a)));
    sides.iter().all(|side| *side >= 0.0)
}

/// The part of the line that each pixel's point of the floor sees; of every `step`-th pixel each way, and not where the
/// camera sees something else.
fn truths(scene: &Scene, length: f32, step: u32) -> Vec<Option<f32>> {
    let light = scene.lights[0].light;
    let solid = triangles(scene);
    let eye = camera().position.as_dvec3();
    let of = |i: u32| {
        let (x, y) = (i % SIZE, i / SIZE);
        // -Z is up in the picture, so rows go along +Z.
        let p = Vec3::new(floor_x(x), 0.0, floor_x(y));
        let skipped = x % step + y % step > 0;
        // Drivers may put corners a sixteenth of a pixel off.
        let aside = 0.1 * f64::from(floor_x(1) - floor_x(0));
        let around = [
            [0.0, 0.0],
            [-1.0, -1.0],
            [-1.0, 1.0],
            [1.0, -1.0],
            [1.0, 1.0],
        ];
        let covered = || {
            let points = around.map(|[x, z]| p.as_dvec3() + aside * DVec3::new(x, 0.0, z));
            let mut rays = points
                .iter()
                .flat_map(|p| solid.iter().map(move |t| (*t, *p)));
            rays.any(|(blocker, p)| is_between(blocker, p, eye))
        };
        (!skipped && !covered()).then(|| truth(&light, length, &solid, p))
    };
    (0..SIZE * SIZE).map(of).collect()
}

/// Root mean square and largest error.
fn error(image: &[f32], truths: &[Option<f32>]) -> (f32, f32) {
    let pairs = image.iter().zip(truths);
    let errors: Vec<f32> = pairs
        .filter_map(|(v, truth)| Some((v - (*truth)?).abs()))
        .collect();
    assert!(errors.len() > 100);
    let squares: f32 = errors.iter().map(|e| e * e).sum();
    let worst = errors.iter().copied().fold(0.0, f32::max);
    ((squares / errors.len() as f32).sqrt(), worst)
}

/// The part of the line that a point of the floor sees.
fn truth(line: &AreaLight, length: f32, blockers: &[[DVec3; 3]], p: Vec3) -> f32 {
    let (center, along) = (line.center.as_dvec3(), line.axis_x.as_dvec3());
    let free = (0..PLACES).filter(|place| {
        let t = (f64::from(*place) + 0.5) / f64::from(PLACES) - 0.5;
        let to = center + along * (t * f64::from(length));
        let p = p.as_dvec3();
        to.y > 0.0 && !blockers.iter().any(|blocker| is_between(*blocker, p, to))
    });
    free.count() as f32 / PLACES as f32
}

fn lit_by(primitives: &[Primitive], line: &Line) -> Scene {
    let shape = LightShape::Line {
        length: line.length,
    };
    let mut scene = scene(primitives.to_vec(), shape);
    let along = Vec3::from(line.along).normalize();
    let light = AreaLight::new(
        shape,
        line.center.into(),
        along.any_orthonormal_vector(),
        along,
    );
    scene.lights[0].light = light;
    scene.finish().unwrap();
    scene
}

/// Plates of several heights and a standing one, aslant to the picture's axes and to each other.
fn blockers() -> Vec<Primitive> {
    let mut all = vec![floor()];
    for (i, (x, depth)) in [(-0.9, 9.0), (-0.2, 8.5), (0.25, 9.4), (0.7, 9.7)]
        .into_iter()
        .enumerate()
    {
        let mut blocker = plate("blocker", [x, x + 0.35], [-1.1, 0.9], depth);
        for p in &mut blocker.positions {
            p.x += p.z * (0.13 + 0.1 * i as f32);
            p.y += p.z * 0.11;
        }
        all.push(blocker);
    }
    let corners = [
        [-0.6, 0.02, 0.5],
        [0.5, 0.02, 1.2],
        [0.5, 0.5, 1.2],
        [-0.6, 0.5, 0.5],
    ];
    all.push(quad("screen", corners.map(Vec3::from)));
    all
}

#[test]
fn lines_of_any_length_and_direction() {
    let _one = support::serial();
    let line = |name, center, along, length| Line {
        name,
        center,
        along,
        length,
    };
    let lines = [
        line("above, along rows", [0.0, 10.0, 0.0], [1.0, 0.0, 0.0], 2.0),
        line(
            "above, along columns",
            [0.3, 4.0, -0.2],
            [0.0, 0.0, 1.0],
            3.0,
        ),
        line(
            "above, aslant and tilted",
            [-0.5, 3.0, 0.5],
            [0.6, 0.5, 0.6],
            1.5,
        ),
        line("standing beside", [4.0, 2.0, 1.0], [0.0, 1.0, 0.0], 2.5),
        line("lying beside, low", [-5.0, 1.5, 0.4], [0.2, 0.1, 1.0], 4.0),
        line(
            "partly below the floor",
            [2.5, 0.5, -1.5],
            [0.3, 1.0, 0.2],
            3.0,
        ),
        line("long and far", [30.0, 80.0, 20.0], [1.0, 0.3, -0.5], 60.0),
        line(
            "longer than all that it lights",
            [0.0, 6.0, 0.0],
            [1.0, 0.0, 0.2],
            50.0,
        ),
        line("short", [1.0, 5.0, 1.0], [1.0, 0.4, 0.3], 0.05),
    ];
    let primitives = blockers();
    for line in &lines {
        let scene = lit_by(&primitives, line);
        let images = render(&scene, &["oess", "oess", "oess:outreach=hull"]);
        assert_eq!(images[0], images[1], "{}: not repeatable", line.name);
        assert!(
            images[0].iter().any(|v| *v > 0.0 && *v < 1.0),
            "{}",
            line.name
        );
        let truths = truths(&scene, line.length, 3);
        let (rms, worst) = error(&images[0], &truths);
        let (hull_rms, hull_worst) = error(&images[2], &truths);
        println!(
            "{}: {rms}, at most {worst}; hull {hull_rms}, at most {hull_worst}",
            line.name
        );
        // Where a surface cuts through the line, rays to 32 places of it decide.
        let (most_rms, most) = match line.name {
            "partly below the floor" => (0.006, 1.0 / 32.0),
            "longer than all that it lights" => (0.002, 0.005),
            _ => (0.001, 0.005),
        };
        assert!(
            worst <= most && rms <= most_rms,
            "{}: {rms}, at most {worst}",
            line.name
        );
        // Penumbrae of the short one are about as wide as the maps' texels.
        let most_hull = if line.name == "short" { 0.06 } else { 0.03 };
        assert!(hull_rms <= most_hull, "{}: {hull_rms}", line.name);
    }
}

/// The paper's stripes: rows of a map find one edge or another, or miss it, where edges are aslant to them.
#[test]
fn there_are_no_stripes() {
    let _one = support::serial();
    let line = Line {
        name: "",
        center: [0.0, 10.0, 0.0],
        along: [1.0, 0.0, 0.0],
        length: 4.0,
    };
    let scene = lit_by(&blockers(), &line);
    let truths = truths(&scene, line.length, 1);
    // How much the error changes from one row of the picture, and so of the maps, to the next.
    let unevenness = |image: &[f32]| {
        let error = |i: usize| Some(image[i] - truths[i]?);
        let change = |i: usize| Some((error(i)? - error(i - SIZE as usize)?).powi(2));
        let changes: Vec<f32> = (SIZE as usize..image.len()).filter_map(change).collect();
        (changes.iter().sum::<f32>() / changes.len() as f32).sqrt()
    };
    let published = "oess:segments=1,outreach=scatter,edges=texels,find=both,penumbra=place,walk=0";
    let images = render(&scene, &["oess", "oess:outreach=hull", published]);
    let found: Vec<f32> = images.iter().map(|image| unevenness(image)).collect();
    println!(
        "silhouettes {}, hull {}, published {}",
        found[0], found[1], found[2]
    );
    assert!(found[0] <= 0.001 && found[1] <= 0.003, "{found:?}");
    assert!(found[2] > 0.006, "{found:?}");
}
