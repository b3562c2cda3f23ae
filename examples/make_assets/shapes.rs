//! Bodies: flat, round, turned on a lathe.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::math::{V3, across, add, cross, dot, length, scale, sub, unit};
use super::mesh::Mesh;

/// A square in the XZ plane that faces up.
pub fn plane(size: f64) -> Mesh {
    sheet(size, size)
}

pub fn sheet(width: f64, depth: f64) -> Mesh {
    let (x, z) = (0.5 * width, 0.5 * depth);
    let mut mesh = Mesh::default();
    let corners = [[-x, 0.0, z], [x, 0.0, z], [x, 0.0, -z], [-x, 0.0, -z]];
    mesh.flat([0.0, 1.0, 0.0], &corners);
    mesh
}

/// A box about the origin.
pub fn cuboid(size: V3) -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |a: f64, b: f64| {
                let mut p = [0.0; 3];
                p[axis] = 0.5 * size[axis] * sign;
                p[u] = 0.5 * size[u] * a * sign;
                p[v] = 0.5 * size[v] * b;
                p
            };
            let mut normal = [0.0; 3];
            normal[axis] = sign;
            let corners = [
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ];
            mesh.flat(normal, &corners);
        }
    }
    mesh
}

/// A round column that stands on the XZ plane, closed above and below.
pub fn column(sides: u32, radius: f64, height: f64) -> Mesh {
    let mut mesh = Mesh::default();
    let rim = |i: u32, y: f64| {
        let (s, c) = (TAU * f64::from(i % sides) / f64::from(sides)).sin_cos();
        ([radius * c, y, -radius * s], [c, 0.0, -s])
    };
    for i in 0..sides {
        let corners = [
            rim(i, 0.0),
            rim(i + 1, 0.0),
            rim(i + 1, height),
            rim(i, height),
        ];
        mesh.polygon(&corners);
    }
    let ring = |y: f64| (0..sides).map(move |i| rim(i, y).0);
    mesh.flat([0.0, 1.0, 0.0], &ring(height).collect::<Vec<_>>());
    mesh.flat([0.0, -1.0, 0.0], &ring(0.0).rev().collect::<Vec<_>>());
    mesh
}

/// A unit sphere: each face of an icosahedron split into `n * n` triangles.
pub fn sphere(n: u32) -> Mesh {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let faces = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let mut mesh = Mesh::default();
    let mut known = BTreeMap::new();
    for [a, b, c] in faces {
        let mut vertex = |i: u32, j: u32| -> u32 {
            let (u, v) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            let along = |k: usize| {
                let (a, b, c): (f64, f64, f64) = (corners[a][k], corners[b][k], corners[c][k]);
                a + u * (b - a) + v * (c - a)
            };
            let p = unit([along(0), along(1), along(2)]);
            // Neighbouring faces meet in the same vertices.
            let key = p.map(|x| (1e6 * x).round() as i64);
            *known.entry(key).or_insert_with(|| {
                mesh.positions.push(p);
                mesh.normals.push(p);
                (mesh.positions.len() - 1) as u32
            })
        };
        let mut triangles = Vec::new();
        for j in 0..n {
            for i in 0..n - j {
                triangles.extend([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1)]);
                if i + j + 1 < n {
                    triangles.extend([vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)]);
                }
            }
        }
        mesh.indices.extend(triangles);
    }
    mesh
}

/// A wall that stands on the XZ plane, centred in X and Z, with a round-arched gate in the middle.
pub fn arch_wall(width: f64, height: f64, depth: f64, radius: f64, spring: f64) -> Mesh {
    const STEPS: u32 = 16;
    let mut mesh = Mesh::default();
    let (w, d) = (0.5 * width, 0.5 * depth);
    // The outline of the gate, from its left foot over the arch to its right foot, with the
    // direction into the opening.
    let mut gate = vec![([-radius, 0.0], [1.0, 0.0])];
    for i in 0..=STEPS {
        let (s, c) = (PI * (1.0 - f64::from(i) / f64::from(STEPS))).sin_cos();
        gate.push(([radius * c, spring + radius * s], [-c, -s]));
    }
    gate.push(([radius, 0.0], [-1.0, 0.0]));
    let mut face = |x0: f64, y0: f64, x1: f64, y1: f64| {
        let front = [[x0, y0, d], [x1, y1, d], [x1, height, d], [x0, height, d]];
        mesh.flat([0.0, 0.0, 1.0], &front);
        let back = [
            [x1, y1, -d],
            [x0, y0, -d],
            [x0, height, -d],
            [x1, height, -d],
        ];
        mesh.flat([0.0, 0.0, -1.0], &back);
    };
    face(-w, 0.0, -radius, 0.0);
    face(radius, 0.0, w, 0.0);
    for pair in gate[1..gate.len() - 1].windows(2) {
        face(pair[0].0[0], pair[0].0[1], pair[1].0[0], pair[1].0[1]);
    }
    for pair in gate.windows(2) {
        let corner = |at: usize, z: f64| {
            let ([x, y], [nx, ny]) = pair[at];
            ([x, y, z], [nx, ny, 0.0])
        };
        mesh.polygon(&[corner(0, d), corner(0, -d), corner(1, -d), corner(1, d)]);
    }
    mesh.flat(
        [0.0, 1.0, 0.0],
        &[
            [-w, height, d],
            [w, height, d],
            [w, height, -d],
            [-w, height, -d],
        ],
    );
    for x in [-w, w] {
        let s = x.signum();
        let side = [
            [x, 0.0, -s * d],
            [x, height, -s * d],
            [x, height, s * d],
            [x, 0.0, s * d],
        ];
        mesh.flat([s, 0.0, 0.0], &side);
    }
    mesh
}

/// A box of a size that stands on the XZ plane at `at`, turned about +Y.
pub fn block(size: V3, turn: f64, at: V3) -> Mesh {
    cuboid(size)
        .turned(turn)
        .moved([at[0], at[1] + 0.5 * size[1], at[2]])
}

/// The box between two opposite corners.
pub fn slab(low: V3, high: V3) -> Mesh {
    cuboid(sub(high, low)).moved(scale(add(low, high), 0.5))
}

/// A straight bar with round ends cut flat, from `a` (radius `ra`) to `b` (radius `rb`).
pub fn rod(sides: u32, a: V3, b: V3, ra: f64, rb: f64) -> Mesh {
    let (u, v) = across(sub(b, a));
    let along = unit(sub(b, a));
    let side = |i: u32| {
        let (s, c) = (TAU * f64::from(i % sides) / f64::from(sides)).sin_cos();
        add(scale(u, c), scale(v, s))
    };
    let mut mesh = Mesh::default();
    for i in 0..sides {
        let (n, m) = (side(i), side(i + 1));
        mesh.polygon(&[
            (add(a, scale(n, ra)), n),
            (add(a, scale(m, ra)), m),
            (add(b, scale(m, rb)), m),
            (add(b, scale(n, rb)), n),
        ]);
    }
    let ring = |at: V3, r: f64| (0..sides).map(move |i| add(at, scale(side(i), r)));
    mesh.flat(along, &ring(b, rb).collect::<Vec<_>>());
    let back: Vec<_> = ring(a, ra).collect();
    mesh.flat(
        scale(along, -1.0),
        &back.into_iter().rev().collect::<Vec<_>>(),
    );
    mesh
}

/// The outline (radius, height), from its start with the inside to the left, turned about +Y:
/// upwards for an outer wall. Smooth but where a point of the outline comes twice.
pub fn lathe(sides: u32, outline: &[[f64; 2]]) -> Mesh {
    let slope = |a: [f64; 2], b: [f64; 2]| {
        let (r, y) = (b[0] - a[0], b[1] - a[1]);
        let length = r.hypot(y);
        (length > 0.0).then(|| [y / length, -r / length])
    };
    // Of the pieces that meet in a point.
    let normal = |i: usize| {
        let before = i.checked_sub(1).and_then(|h| slope(outline[h], outline[i]));
        let after = outline.get(i + 1).and_then(|next| slope(outline[i], *next));
        let sum = match (before, after) {
            (Some(a), Some(b)) => [a[0] + b[0], a[1] + b[1]],
            (a, b) => a.or(b).unwrap_or([0.0, 1.0]),
        };
        let length = sum[0].hypot(sum[1]);
        sum.map(|x| x / length)
    };
    let mut mesh = Mesh::default();
    for (i, [r, y]) in outline.iter().enumerate() {
        let [nr, ny] = normal(i);
        for k in 0..sides {
            let (s, c) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
            mesh.positions.push([r * c, *y, -r * s]);
            mesh.normals.push([nr * c, ny, -nr * s]);
        }
    }
    let n = sides;
    for i in 1..outline.len() {
        if slope(outline[i - 1], outline[i]).is_none() {
            continue;
        }
        let (low, high) = ((i as u32 - 1) * n, i as u32 * n);
        for k in 0..n {
            let next = (k + 1) % n;
            if outline[i - 1][0] > 0.0 {
                mesh.indices.extend([low + k, low + next, high + k]);
            }
            if outline[i][0] > 0.0 {
                mesh.indices.extend([low + next, high + next, high + k]);
            }
        }
    }
    mesh
}

/// A body that stands on the XZ plane: a rectangle (X and Z) below, another above.
pub fn frustum(below: [f64; 2], above: [f64; 2], height: f64) -> Mesh {
    let corner = |x: f64, z: f64, top: bool| {
        let (size, y) = if top { (above, height) } else { (below, 0.0) };
        [0.5 * x * size[0], y, 0.5 * z * size[1]]
    };
    let round = [[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let ring = |top: bool| round.map(|[x, z]| corner(x, z, top));
    let (low, high) = (ring(false), ring(true));
    let mut mesh = Mesh::default();
    for i in 0..4 {
        let k = (i + 1) % 4;
        mesh.facet(&[low[i], low[k], high[k], high[i]]);
    }
    mesh.facet(&high);
    mesh.facet(&[low[3], low[2], low[1], low[0]]);
    mesh
}

/// A tube along a path of points and radii, smooth; closed where it ends with radius 0.
pub fn tube(sides: u32, path: &[(V3, f64)]) -> Mesh {
    let last = path.len() - 1;
    let (mut u, _) = across(sub(path[1].0, path[0].0));
    let mut mesh = Mesh::default();
    for (i, (center, radius)) in path.iter().enumerate() {
        let (before, after) = (path[i.saturating_sub(1)], path[(i + 1).min(last)]);
        let way = sub(after.0, before.0);
        let along = unit(way);
        // The ring is turned no further than the path turns.
        u = unit(sub(u, scale(along, dot(u, along))));
        let v = cross(along, u);
        let lean = (before.1 - after.1) / length(way);
        for k in 0..sides {
            let (s, c) = (TAU * f64::from(k) / f64::from(sides)).sin_cos();
            let out = add(scale(u, c), scale(v, s));
            mesh.positions.push(add(*center, scale(out, *radius)));
            mesh.normals.push(if *radius > 0.0 {
                unit(add(out, scale(along, lean)))
            } else {
                scale(along, lean.signum())
            });
        }
    }
    let n = sides;
    for i in 1..path.len() {
        let (low, high) = ((i as u32 - 1) * n, i as u32 * n);
        for k in 0..n {
            let next = (k + 1) % n;
            if path[i - 1].1 > 0.0 {
                mesh.indices.extend([low + k, low + next, high + k]);
            }
            if path[i].1 > 0.0 {
                mesh.indices.extend([low + next, high + next, high + k]);
            }
        }
    }
    mesh
}

/// More points on a smooth outline for [`lathe`]: three between each two of `outline`.
pub fn smoothed(outline: &[[f64; 2]]) -> Vec<[f64; 2]> {
    const STEPS: u32 = 4;
    let last = outline.len() - 1;
    let mut points = vec![outline[0]];
    for i in 0..last {
        let [a, b, c, d] = [i.max(1) - 1, i, i + 1, (i + 2).min(last)].map(|k| outline[k]);
        if b == c {
            // A corner stays one.
            points.push(c);
            continue;
        }
        for k in 1..=STEPS {
            let t = f64::from(k) / f64::from(STEPS);
            points.push([0, 1].map(|x| catmull_rom([a[x], b[x], c[x], d[x]], t)));
        }
    }
    points
}

/// A smooth curve through four values, from the second (`t` = 0) to the third (1).
pub fn catmull_rom([a, b, c, d]: [f64; 4], t: f64) -> f64 {
    let (p, q) = (0.5 * (c - a), 0.5 * (d - b));
    let (e, f) = (3.0 * (c - b) - 2.0 * p - q, 2.0 * (b - c) + p + q);
    b + t * (p + t * (e + t * f))
}
