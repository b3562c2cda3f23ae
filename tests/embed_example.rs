//! The host of `examples/embed.rs` gets a picture with a shadow in it, under the validation layer.

#[path = "../examples/embed.rs"]
mod embed;

/// Brightness of a pixel, 0 to 3 * 255.
fn at(picture: &[u8], x: usize, y: usize) -> u32 {
    picture[3 * (384 * y + x)..][..3]
        .iter()
        .map(|c| u32::from(*c))
        .sum()
}

#[test]
fn a_host_lights_its_picture_through_our_mask() {
    let soft = embed::run("pcss").unwrap();
    let hard = embed::run("hard").unwrap();
    assert_eq!(soft.len(), 3 * 384 * 384);
    // Most pixels do not care how soft a shadow is; its border does.
    let differ = soft.iter().zip(&hard).filter(|(a, b)| a != b).count() / 3;
    assert!((200..20_000).contains(&differ), "{differ} pixels differ");
    // The floor in front of the boxes is lit; there is dark and there is light.
    assert!(at(&soft, 192, 370) > 300, "{}", at(&soft, 192, 370));
    let dark = (0..384 * 384)
        .filter(|i| at(&soft, i % 384, i / 384) < 200)
        .count();
    assert!(dark > 1000, "{dark} dark pixels");
}
