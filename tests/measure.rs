//! Error measures against numbers worked out by hand, heat maps, perceived difference.
#![cfg(feature = "cli")]

use antumbra::measure::{MeasureError, flip, heat_map, measure};

#[test]
fn measures_by_hand() {
    // truth: umbra, umbra, lit, lit, penumbra x 3, and one invalid pixel.
    let truth = [0.0, 0.005, 1.0, 0.995, 0.5, 0.25, 0.006, 0.5];
    let image = [1.0, 0.1, 0.0, 0.995, 0.25, 0.5, 0.006, f32::NAN];
    let valid = [true, true, true, true, true, true, true, false];
    let found = measure(&image, &truth, &valid).unwrap();
    assert_eq!((found.valid.pixels, found.penumbra.pixels), (7, 3));
    let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-7, "{a} is not {b}");
    close(found.umbra_called_lit, 1.0 / 7.0);
    close(found.lit_called_umbra, 1.0 / 7.0);
    close(found.penumbra.rmse, (2.0 * 0.0625_f64 / 3.0).sqrt());
    close(found.penumbra.bias, 0.0);
    close(found.penumbra.mae, 0.5 / 3.0);
    close(found.penumbra.max, 0.25);
    close(found.valid.bias, 0.095 / 7.0);
    close(found.valid.mae, 2.595 / 7.0);
    close(found.valid.max, 1.0);
}

#[test]
fn percentiles_are_ranks() {
    let truth = vec![0.5; 1000];
    let image: Vec<f32> = (0..1000).map(|i| 0.5 + i as f32 / 4000.0).collect();
    let found = measure(&image, &truth, &[true; 1000]).unwrap().penumbra;
    // 990 of 1000 are at most the 990th.
    assert!((found.p99 - 989.0 / 4000.0).abs() < 1e-6, "{}", found.p99);
    assert!((found.max - 999.0 / 4000.0).abs() < 1e-6);
    let one = measure(&[0.75], &[0.5], &[true]).unwrap().penumbra;
    assert_eq!((one.p99, one.max, one.bias), (0.25, 0.25, 0.25));
}

#[test]
fn nothing_to_measure_is_no_error() {
    let none = measure(&[0.5], &[0.5], &[false]).unwrap();
    assert_eq!((none.valid.pixels, none.valid.rmse), (0, 0.0));
    assert_eq!(measure(&[], &[], &[]).unwrap(), Default::default());
}

#[test]
fn what_cannot_be_measured_is_named() {
    let count = measure(&[0.5], &[0.5, 0.5], &[true]).unwrap_err();
    assert!(count.to_string().contains("1 values"), "{count}");
    let nan = measure(&[0.5, f32::NAN], &[0.5; 2], &[true; 2]).unwrap_err();
    assert!(matches!(
        nan,
        MeasureError::NotFinite {
            which: "image",
            index: 1,
            ..
        }
    ));
    let infinite = measure(&[0.5], &[f32::INFINITY], &[true]).unwrap_err();
    assert!(
        infinite.to_string().contains("reference has the value inf"),
        "{infinite}"
    );
}

#[test]
fn heat_maps_show_errors_over_a_legend() {
    let (width, height) = (120, 2);
    let mut image = vec![0.5; 240];
    (image[0], image[1], image[2], image[3]) = (0.25, 0.75, 9.0, 0.5);
    let mut valid = vec![true; 240];
    valid[3] = false;
    let map = heat_map(width, height, &image, &[0.5; 240], &valid, 0.25);
    assert_eq!((map.width, map.height > height), (width, true));
    assert_eq!(map.rgb.len(), 3 * (map.width * map.height) as usize);
    let at = |x: usize, y: usize| &map.rgb[3 * (y * 120 + x)..][..3];
    let is_blue = |c: &[u8]| c[2] > c[0] + 50;
    let is_red = |c: &[u8]| c[0] > c[2] + 50;
    assert!(is_blue(at(0, 0)) && is_red(at(1, 0)));
    assert_eq!(
        at(1, 0),
        at(2, 0),
        "beyond the range is the end of the scale"
    );
    assert_eq!(at(3, 0), [70; 3]);
    assert_eq!(at(4, 0), [247; 3]);
    // The strip runs from blue to red, and digits stand below.
    assert!(is_blue(at(1, 6)) && is_red(at(118, 6)));
    let dark = map.rgb[3 * 120 * 10..]
        .chunks(3)
        .filter(|c| *c == [0, 0, 0])
        .count();
    assert!(dark > 100, "{dark}");
    // Too narrow for digits, not too narrow for a map; bad ranges make no NaN.
    for range in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let map = heat_map(1, 1, &[f32::NAN], &[0.5], &[true], range);
        assert_eq!(map.rgb[..3], [70; 3]);
    }
}

#[test]
fn flip_sees_differences() {
    let grey = |value: u8| vec![value; 3 * 32 * 32];
    let same = flip(32, 32, &grey(100), &grey(100)).unwrap();
    assert_eq!((same.mean, same.max), (0.0, 0.0));
    let near = flip(32, 32, &grey(104), &grey(100)).unwrap();
    let far = flip(32, 32, &grey(200), &grey(100)).unwrap();
    assert!(0.0 < near.mean && near.mean < 0.1 && far.mean > 2.0 * near.mean);
    assert_eq!(far.map.len(), 32 * 32);
    assert!(flip(32, 32, &grey(1), &[0; 5]).is_none());
    assert!(flip(0, 0, &[], &[]).is_none());
}
