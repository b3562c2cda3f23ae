//! Materials, their images, and where these lie.

use std::f32::consts::FRAC_PI_2;

use antumbra::scene::{LoadOptions, Scene, Wrap};
use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};

use super::model::{Model, U8, U16, jpeg, png};
use super::{Result, data_uri, load, message};

const CHECKS: [[u8; 4]; 4] = [
    [255, 0, 0, 255],
    [0, 255, 0, 128],
    [0, 0, 255, 0],
    [9, 8, 7, 6],
];

/// The square with coordinates 0 to 1, v down, and `image` as its base texture.
fn textured(image: Value) -> Model {
    let mut model = Model::square();
    let uvs = model.floats("VEC2", &[0., 1., 1., 1., 1., 0., 0., 0.]);
    model.attribute("TEXCOORD_0", uvs);
    model.primitive()["material"] = json!(0);
    model.json["images"] = json!([image]);
    model.json["textures"] = json!([{"source": 0}]);
    model.json["materials"] = json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    model
}

fn embedded(bytes: &[u8]) -> Model {
    textured(json!({"uri": data_uri(bytes)}))
}

#[test]
fn images_are_read_from_a_view_a_uri_and_a_file() -> Result {
    let bytes = png(2, 2, &CHECKS);
    let folder = tempfile::tempdir()?;
    std::fs::create_dir(folder.path().join("maps"))?;
    std::fs::write(folder.path().join("maps/a b.png"), &bytes)?;
    let mut from_view = textured(json!(null));
    let view = from_view.view(&bytes);
    from_view.json["images"] =
        json!([{"name": "checks", "bufferView": view, "mimeType": "image/png"}]);
    for (model, name) in [
        (from_view, "checks"),
        (embedded(&bytes), "image 0"),
        (textured(json!({"uri": "maps/a%20b.png"})), "maps/a%20b.png"),
    ] {
        let path = folder.path().join("scene.glb");
        let scene = Scene::load_slice(path, &model.glb(), &LoadOptions::default())?;
        assert_eq!(scene.images.len(), 1);
        let image = &scene.images[0];
        assert_eq!((image.width, image.height), (2, 2));
        assert_eq!(image.texels, CHECKS);
        assert_eq!(image.name, name);
        let texture = scene.materials[scene.primitives[0].material].base_texture;
        assert_eq!(texture.map(|texture| texture.image), Some(0));
        // Flat triangles share no vertex, and each keeps its own coordinates.
        let corners = [[0., 1.], [1., 1.], [1., 0.], [0., 1.], [1., 0.], [0., 0.]];
        assert_eq!(scene.primitives[0].uvs, corners.map(Vec2::from_array));
    }
    Ok(())
}

#[test]
fn jpegs_and_grey_and_deep_pngs_become_rgba() -> Result {
    let scene = load(&embedded(&jpeg(8, 8, &[[200, 100, 50, 255]; 64])).text())?;
    let image = &scene.images[0];
    assert_eq!((image.width, image.height, image.texels.len()), (8, 8, 64));
    for texel in &image.texels {
        for (found, wanted) in texel.iter().zip([200u8, 100, 50, 255]) {
            assert!(found.abs_diff(wanted) <= 3, "{texel:?}");
        }
    }
    let grey = image::GrayImage::from_raw(2, 1, vec![10, 200]).ok_or("size")?;
    let deep = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(1, 1, vec![0u16, 32896, 65535]);
    for (picture, wanted) in [
        (image::DynamicImage::from(grey), [10, 10, 10, 255]),
        (deep.ok_or("size")?.into(), [0, 128, 255, 255]),
    ] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png)?;
        let scene = load(&embedded(&bytes.into_inner()).text())?;
        assert_eq!(scene.images[0].texels[0], wanted);
    }
    Ok(())
}

#[test]
fn coordinates_come_from_the_set_the_texture_names() -> Result {
    let mut model = embedded(&png(2, 2, &CHECKS));
    let bytes: Vec<u8> = [0u16, 65535, 65535, 65535, 32768, 0, 13107, 0]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let second = model.normalized(U16, "VEC2", &bytes);
    let third = model.normalized(U8, "VEC2", &[0, 255, 255, 255, 51, 0, 0, 0]);
    model.attribute("TEXCOORD_1", second);
    model.attribute("TEXCOORD_2", third);
    // Corner 2, which is the third one of the first triangle.
    for (set, corner) in [
        (0, [1.0, 0.0]),
        (1, [32768.0 / 65535.0, 0.0]),
        (2, [0.2, 0.0]),
    ] {
        model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] =
            json!(set);
        let found = load(&model.text())?.primitives[0].uvs[2];
        assert!(found.abs_diff_eq(Vec2::from_array(corner), 1e-7), "{found}");
    }
    // A set that is not there: one place of the image for all.
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = json!(3);
    assert_eq!(load(&model.text())?.primitives[0].uvs, [Vec2::ZERO; 6]);
    // No texture, no coordinates.
    model.json["materials"] = json!([{}]);
    assert!(load(&model.text())?.primitives[0].uvs.is_empty());
    Ok(())
}

#[test]
fn texture_transforms_scale_then_turn_then_move() -> Result {
    let mut model = embedded(&png(2, 2, &CHECKS));
    let other = model.floats("VEC2", &[1., 0., 0., 1., 0., 0., 5., 5.]);
    model.attribute("TEXCOORD_1", other);
    model.json["extensionsRequired"] = json!(["KHR_texture_transform"]);
    model.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = json!({"KHR_texture_transform": {"offset": [0.25, 0.5], "scale": [2, 3],
               "rotation": FRAC_PI_2, "texCoord": 1}});
    let scene = load(&model.text())?;
    // A quarter turn counter-clockwise with v down takes right (1, 0) to up (0, -1), and down
    // (0, 1) to right (1, 0).
    for (found, wanted) in (scene.primitives[0].uvs.iter()).zip([
        Vec2::new(0.25, -1.5),
        Vec2::new(3.25, 0.5),
        Vec2::new(0.25, 0.5),
    ]) {
        assert!(found.abs_diff_eq(wanted, 1e-6), "{found} is not {wanted}");
    }
    Ok(())
}

#[test]
fn samplers_say_how_images_go_on() -> Result {
    let mut model = embedded(&png(2, 2, &CHECKS));
    let wrap = |model: &Model| -> Result<[Wrap; 2]> {
        let scene = load(&model.text())?;
        Ok(scene.materials[0].base_texture.ok_or("no texture")?.wrap)
    };
    assert_eq!(wrap(&model)?, [Wrap::Repeat; 2]);
    model.json["textures"][0]["sampler"] = json!(0);
    for (s, t, wanted) in [
        (33071, 33648, [Wrap::Clamp, Wrap::Mirror]),
        (10497, 33071, [Wrap::Repeat, Wrap::Clamp]),
    ] {
        model.json["samplers"] = json!([{"wrapS": s, "wrapT": t, "magFilter": 9728}]);
        assert_eq!(wrap(&model)?, wanted);
    }
    model.json["samplers"] = json!([{"wrapS": 33072}]);
    assert!(message(&model.text()).contains("samplers[0]"));
    Ok(())
}

#[test]
fn images_are_read_once_and_only_for_materials_in_use() -> Result {
    let mut model = embedded(&png(2, 2, &CHECKS));
    model.push("images", json!({"uri": "missing.png"}));
    model.push("textures", json!({"source": 1}));
    model.push("textures", json!({"source": 0}));
    for texture in [1, 2] {
        model.push(
            "materials",
            json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}),
        );
    }
    let second = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "material": 2});
    super::push(&mut model.json["meshes"][0], "primitives", second);
    let scene = load(&model.text())?;
    assert_eq!(scene.images.len(), 1);
    assert_eq!(scene.materials[1].base_texture, None);
    assert_eq!(
        scene.materials[0].base_texture,
        scene.materials[2].base_texture
    );
    model.primitive()["material"] = json!(1);
    let message = message(&model.text());
    assert!(
        message.contains("image 1: cannot read its data `missing.png`"),
        "{message}"
    );
    Ok(())
}

#[test]
fn images_that_cannot_be_are_refused() {
    let good = png(2, 2, &CHECKS);
    let mut giant = good.clone();
    // Width and height of the header, and the checksum over it.
    giant[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let sum = crc32(&giant[12..29]).to_be_bytes();
    giant[29..33].copy_from_slice(&sum);
    let mut giant_jpeg = jpeg(8, 8, &[[0; 4]; 64]);
    let frame = (giant_jpeg.windows(2)).position(|two| two == [0xff, 0xc0]);
    if let Some(frame) = frame {
        giant_jpeg[frame + 5..frame + 9].copy_from_slice(&[0x3f, 0xff, 0x3f, 0xff]);
    }
    for (bytes, wanted) in [
        (&good[..40], "image 0: it cannot be decoded"),
        (&good[..10], "image 0: it cannot be decoded"),
        (b"nothing", "image 0: it is neither PNG nor JPEG"),
        (b"", "image 0: it is neither PNG nor JPEG"),
        (
            b"RIFF\x10\0\0\0WEBPVP8 ",
            "format WebP is not supported; export it as PNG",
        ),
        (&giant, "image 0: it claims 16384x16384 texels in"),
        (&giant_jpeg, "image 0: it claims 16383x16383 texels in"),
    ] {
        let message = message(&embedded(bytes).text());
        assert!(message.contains(wanted), "{message} lacks {wanted}");
        assert!(!message.contains('\n'), "{message}");
    }
    for (image, wanted) in [
        (json!({"uri": "../outside.png"}), "leaves the folder"),
        (json!({}), "neither `bufferView` nor `uri`"),
        (json!({"bufferView": 99}), "images[0].bufferView"),
    ] {
        let message = message(&textured(image).text());
        assert!(message.contains(wanted), "{message} lacks {wanted}");
    }
    let mut missing = embedded(&good);
    missing.json["textures"] = json!([{"source": 7}]);
    assert!(message(&missing.text()).contains("textures[0].source"));
    let mut bad_uv = embedded(&good);
    let uvs = bad_uv.floats("VEC2", &[0., 0., 1., f32::NAN, 0., 0., 0., 0.]);
    bad_uv.attribute("TEXCOORD_0", uvs);
    assert!(message(&bad_uv.text()).contains("TEXCOORD_0 of vertex 1 is not finite"));
}

#[test]
fn images_are_bounded_by_the_options() {
    let model = embedded(&png(3, 2, &[[1, 2, 3, 4]; 6]));
    let with = |change: fn(&mut LoadOptions)| {
        let mut options = LoadOptions::default();
        change(&mut options);
        let scene = Scene::load_slice("test.glb", &model.glb(), &options);
        scene.map_err(|error| error.to_string())
    };
    assert!(with(|options| options.max_texels = 6).is_ok());
    assert!(with(|options| options.max_image_side = 3).is_ok());
    for (found, wanted) in [
        (with(|options| options.max_texels = 5), "3x2"),
        (with(|options| options.max_image_side = 2), "image 0: it"),
    ] {
        assert!(found.is_err_and(|message| message.contains(wanted)));
    }
}

#[test]
fn factors_are_multiplied_by_the_mean_of_their_texture() -> Result {
    let mut model = embedded(&png(2, 1, &[[0, 255, 51, 255], [255, 0, 51, 255]]));
    model.json["materials"] = json!([{
        "pbrMetallicRoughness": {"roughnessFactor": 0.5, "metallicRoughnessTexture": {"index": 0}},
        "emissiveFactor": [1, 0.5, 0.25], "emissiveTexture": {"index": 0},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3}}
    }]);
    let scene = load(&model.text())?;
    let material = &scene.materials[0];
    assert!((material.roughness - 0.25).abs() < 1e-6, "{material:?}");
    assert!((material.metallic - 0.2).abs() < 1e-6, "{material:?}");
    // 51 of 255 in sRGB is 0.0331 in linear light: ((0.2 + 0.055) / 1.055) ^ 2.4.
    let wanted = Vec3::new(1.5, 0.75, 0.75 * 0.033_105);
    assert!(material.emissive.abs_diff_eq(wanted, 1e-5), "{material:?}");
    assert!(scene.images.is_empty(), "only means are kept");
    // Without textures the factors stand, and those of a material that says nothing are 1.
    model.json["materials"] = json!([{"emissiveFactor": [0.1, 0.2, 0.3]}]);
    let material = load(&model.text())?.materials[0].clone();
    assert_eq!((material.metallic, material.roughness), (1.0, 1.0));
    assert_eq!(material.emissive, Vec3::new(0.1, 0.2, 0.3));
    model.json["materials"] = json!([{"emissiveFactor": [3e38, 0, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 3e38}}}]);
    let message = message(&model.text());
    assert!(message.contains("material 0: emissive colour"), "{message}");
    Ok(())
}

#[test]
fn specular_glossiness_shows_its_diffuse_part() -> Result {
    let mut model = embedded(&png(2, 2, &CHECKS));
    model.json["extensionsRequired"] = json!(["KHR_materials_pbrSpecularGlossiness"]);
    model.json["materials"] = json!([{"extensions": {"KHR_materials_pbrSpecularGlossiness":
        {"diffuseFactor": [0.5, 0.25, 1, 1], "glossinessFactor": 0.75,
         "diffuseTexture": {"index": 0}}}}]);
    let scene = load(&model.text())?;
    let material = &scene.materials[0];
    assert_eq!(material.base_color, Vec4::new(0.5, 0.25, 1.0, 1.0));
    assert_eq!((material.metallic, material.roughness), (0.0, 0.25));
    assert!(material.base_texture.is_some());
    assert_eq!(scene.primitives[0].uvs.len(), 6);
    Ok(())
}

#[test]
fn one_colour_of_all_vertices_goes_into_the_material() -> Result {
    let mut model = Model::square();
    model.json["materials"] =
        json!([{"name": "paint", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}]);
    let blue = model.normalized(U8, "VEC4", &[51, 102, 255, 255].repeat(4));
    let same = model.floats("VEC3", &[0.2, 0.4, 1.0].repeat(4));
    let white = model.floats("VEC3", &[1.0; 12]);
    let mixed = model.floats("VEC3", &[0., 0., 0., 1., 1., 1., 0., 0., 0., 0., 0., 0.]);
    let primitives = [blue, same, white, mixed]
        .map(|color| json!({"attributes": {"POSITION": 0, "COLOR_0": color}, "material": 0}));
    model.json["meshes"][0]["primitives"] = json!(primitives);
    let scene = load(&model.text())?;
    let color = |i: usize| scene.materials[scene.primitives[i].material].base_color;
    for i in [0, 1] {
        assert!(
            color(i).abs_diff_eq(Vec4::new(0.1, 0.4, 1.0, 1.0), 1e-6),
            "{}",
            color(i)
        );
        assert_eq!(scene.materials[scene.primitives[i].material].name, "paint");
    }
    for i in [2, 3] {
        assert_eq!(scene.primitives[i].material, 0);
    }
    assert_eq!(scene.materials[0].base_color, Vec4::new(0.5, 1.0, 1.0, 1.0));
    Ok(())
}

/// The checksum of PNG chunks, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            if sum & 1 == 1 {
                sum >> 1 ^ 0xedb8_8320
            } else {
                sum >> 1
            }
        })
    })
}
