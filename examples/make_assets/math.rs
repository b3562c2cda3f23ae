//! Vectors, rotations and chance.

pub type V3 = [f64; 3];

/// Rotation as a quaternion, x y z w.
pub type Quat = [f64; 4];

pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: V3, by: f64) -> V3 {
    a.map(|x| x * by)
}

pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V3, b: V3) -> V3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub fn length(v: V3) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

pub fn unit(v: V3) -> V3 {
    let length = length(v);
    v.map(|x| x / length)
}

pub fn mix(a: V3, b: V3, t: f64) -> V3 {
    add(a, scale(sub(b, a), t))
}

/// 0 up to `from`, 1 beyond `to`, smooth between.
pub fn smoothstep(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Two unit vectors that stand on `axis` and on each other; right-handed with it.
pub fn across(axis: V3) -> (V3, V3) {
    let axis = unit(axis);
    let helper = if axis[1].abs() < 0.9 {
        [0.0, 1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    };
    let u = unit(cross(helper, axis));
    (u, cross(axis, u))
}

/// `x` without the digits in which platforms differ, and without a minus before 0.
pub fn rounded(x: f64, per_unit: f64) -> f64 {
    (x * per_unit).round() / per_unit + 0.0
}

/// The rotation that turns -Z from `eye` to `target`, with `up` (not along the way) as far along
/// +Y as can be.
pub fn look_at(eye: V3, target: V3, up: V3) -> Quat {
    let z = unit([eye[0] - target[0], eye[1] - target[1], eye[2] - target[2]]);
    let x = unit(cross(up, z));
    let y = cross(z, x);
    // Of the four ways to take a quaternion out of a matrix, each is exact where its divisor is
    // large: the first for all but turns by nearly half a turn.
    let by_trace = 1.0 + x[0] + y[1] + z[2];
    let q = if by_trace > 0.04 {
        [y[2] - z[1], z[0] - x[2], x[1] - y[0], by_trace]
    } else if x[0] > y[1].max(z[2]) {
        let by_x = 1.0 + x[0] - y[1] - z[2];
        [by_x, x[1] + y[0], z[0] + x[2], y[2] - z[1]]
    } else if y[1] > z[2] {
        let by_y = 1.0 - x[0] + y[1] - z[2];
        [x[1] + y[0], by_y, y[2] + z[1], z[0] - x[2]]
    } else {
        let by_z = 1.0 - x[0] - y[1] + z[2];
        [z[0] + x[2], y[2] + z[1], by_z, x[1] - y[0]]
    };
    let length = q.map(|x| x * x).iter().sum::<f64>().sqrt();
    q.map(|x| rounded(x / length, 1e9))
}

/// The rotation by `angle` about the unit vector `axis`.
pub fn about(axis: V3, angle: f64) -> Quat {
    let (s, c) = (0.5 * angle).sin_cos();
    [axis[0] * s, axis[1] * s, axis[2] * s, c].map(|q| rounded(q, 1e9))
}

/// `a` after `b`.
pub fn combined(a: Quat, b: Quat) -> Quat {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
    .map(|q| rounded(q, 1e9))
}

/// A fixed series of numbers that looks like chance (SplitMix64).
pub struct Chance(pub u64);

impl Chance {
    /// From 0 to below 1.
    pub fn part(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.part()
    }

    /// A point in the unit ball.
    pub fn in_ball(&mut self) -> V3 {
        loop {
            let v = [(); 3].map(|()| self.between(-1.0, 1.0));
            if dot(v, v) <= 1.0 {
                return v;
            }
        }
    }
}
