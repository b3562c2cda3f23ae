//! The alphas that a look for holes lies between.

use crate::scene::{TextureImage, Wrap};

/// Numbers of the first of two neighbours along an axis that all others are like: as many as it
/// takes before they come again. Twin of `fetch_holes` in `common/holes.glsl`.
fn places(wrap: Wrap, size: u32) -> std::ops::Range<i64> {
    let size = i64::from(size);
    match wrap {
        Wrap::Repeat => 0..size,
        Wrap::Mirror => 0..2 * size,
        Wrap::Clamp => -1..size,
    }
}

/// Row by row the alphas at (0, 0), (1, 0), (0, 1) and (1, 1) of all squares of four neighbouring
/// texels, within the image and beyond its borders.
pub(super) fn footprints(image: &TextureImage, wrap: [Wrap; 2]) -> Vec<[u8; 4]> {
    let pairs = |axis: usize, size: u32| -> Vec<[usize; 2]> {
        let wrap = wrap[axis];
        let pair = |i: i64| [i, i + 1].map(|i| wrap.texel(i, size) as usize);
        places(wrap, size).map(pair).collect()
    };
    let (across, down) = (pairs(0, image.width), pairs(1, image.height));
    let alpha = |x: usize, y: usize| image.texels[y * image.width as usize + x][3];
    let row = |[upper, lower]: &[usize; 2]| {
        let (upper, lower) = (*upper, *lower);
        let cell = move |[left, right]: &[usize; 2]| {
            let (left, right) = (*left, *right);
            [
                alpha(left, upper),
                alpha(right, upper),
                alpha(left, lower),
                alpha(right, lower),
            ]
        };
        across.iter().map(cell)
    };
    down.iter().flat_map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> TextureImage {
        TextureImage {
            name: String::new(),
            width: 2,
            height: 1,
            texels: vec![[0, 0, 0, 10], [0, 0, 0, 20]],
        }
    }

    #[test]
    fn repeated_footprints_go_on_at_the_other_border() {
        let found = footprints(&image(), [Wrap::Repeat; 2]);
        assert_eq!(found, [[10, 20, 10, 20], [20, 10, 20, 10]]);
    }

    #[test]
    fn clamped_footprints_begin_before_the_border() {
        let found = footprints(&image(), [Wrap::Clamp, Wrap::Repeat]);
        let expected = [[10, 10, 10, 10], [10, 20, 10, 20], [20, 20, 20, 20]];
        assert_eq!(found, expected);
    }

    #[test]
    fn mirrored_footprints_go_there_and_back() {
        let found = footprints(&image(), [Wrap::Mirror, Wrap::Repeat]);
        let row: Vec<[u8; 2]> = found.iter().map(|f| [f[0], f[1]]).collect();
        assert_eq!(row, [[10, 20], [20, 20], [20, 10], [10, 10]]);
        assert_eq!(footprints(&image(), [Wrap::Repeat, Wrap::Mirror]).len(), 4);
    }
}
