//! Lights and cameras by NAME or INDEX, and the command line's changes to lights.

use std::fmt::Write as _;

use super::error::shorten;
use super::{Scene, SceneCamera, SceneError, SceneLight};
use crate::light::LightOverrides;

impl Scene {
    /// The index into [`Scene::lights`] of the light called `asked`, or with that number in
    /// document order; a name wins over a number. `None` asks for the first one.
    ///
    /// # Errors
    /// [`SceneError::NoLight`], [`SceneError::NotFound`] (with a list) or
    /// [`SceneError::Ambiguous`].
    pub fn select_light(&self, asked: Option<&str>) -> Result<usize, SceneError> {
        if self.lights.is_empty() {
            return Err(SceneError::NoLight { file: self.label() });
        }
        let Some(asked) = asked else { return Ok(0) };
        let items = || self.lights.iter().map(|l| l.name.as_str()).enumerate();
        let index = self.find("light", asked, items())?;
        Ok(index)
    }

    /// The camera called `asked`, or with that number in document order; a name wins over a
    /// number. `None` asks for the first one, or in a scene without one for
    /// [`SceneCamera::framing`].
    ///
    /// # Errors
    /// [`SceneError::NoCamera`], [`SceneError::NotFound`] (with a list),
    /// [`SceneError::Ambiguous`], or [`SceneError::Unsupported`] for an orthographic camera.
    pub fn select_camera(&self, asked: Option<&str>) -> Result<SceneCamera, SceneError> {
        let Some(asked) = asked else {
            return match (self.cameras.first(), self.orthographic_cameras.first()) {
                (Some(camera), _) => Ok(camera.clone()),
                (None, Some((_, name))) => Err(self.orthographic(name)),
                (None, None) => Ok(SceneCamera::framing(&self.bounds)),
            };
        };
        let mut items: Vec<_> = (self.cameras.iter())
            .map(|camera| (camera.index, camera.name.as_str()))
            .chain(
                self.orthographic_cameras
                    .iter()
                    .map(|(i, n)| (*i, n.as_str())),
            )
            .collect();
        items.sort_by_key(|(index, _)| *index);
        if items.is_empty() {
            return Err(SceneError::NoCamera { file: self.label() });
        }
        let index = self.find("camera", asked, items.iter().copied())?;
        match self.cameras.iter().find(|camera| camera.index == index) {
            Some(camera) => Ok(camera.clone()),
            None => Err(self.orthographic(asked)),
        }
    }

    /// Applies the command line's changes to the light `selected` (an index into
    /// [`Scene::lights`]), else to all lights of the kind that each change is for: shape and size
    /// to those that are no sun, the sun's angle to suns, the scale to all.
    ///
    /// # Errors
    /// [`SceneError::Light`] if a change does not fit, [`SceneError::OverrideUnused`] if it is for
    /// a kind of which there is no light, [`SceneError::NoLight`] if there is none at all. The
    /// scene is then unchanged.
    pub fn override_lights(
        &mut self,
        overrides: &LightOverrides,
        selected: Option<usize>,
    ) -> Result<(), SceneError> {
        if overrides.is_empty() {
            return Ok(());
        }
        if self.lights.is_empty() {
            return Err(SceneError::NoLight { file: self.label() });
        }
        if selected.is_none() {
            self.check_overrides_used(overrides)?;
        }
        let file = self.label();
        let mut changed = Vec::with_capacity(self.lights.len());
        for (index, old) in self.lights.iter().enumerate() {
            let overrides = match selected {
                Some(selected) if selected != index => LightOverrides::default(),
                Some(_) => *overrides,
                None => overrides.for_kind_of(&old.light.shape),
            };
            let light = overrides
                .apply(&old.light)
                .map_err(|source| SceneError::Light {
                    file: file.clone(),
                    light: shorten(&old.name),
                    source,
                })?;
            changed.push(light);
        }
        for (light, changed) in self.lights.iter_mut().zip(changed) {
            light.light = changed;
        }
        Ok(())
    }

    /// An option that changes nothing is a mistake worth telling.
    fn check_overrides_used(&self, overrides: &LightOverrides) -> Result<(), SceneError> {
        let is_sun = |light: &SceneLight| light.light.shape.is_sun();
        let any_sun = self.lights.iter().any(is_sun);
        let any_other = !self.lights.iter().all(is_sun);
        let option = if overrides.sun_angle.is_some() && !any_sun {
            "--sun-angle"
        } else if overrides.shape.is_some() && !any_other {
            "--light-shape"
        } else if overrides.size.is_some() && !any_other {
            "--light-size"
        } else if overrides.profile.is_some() && !any_other {
            "--light-profile"
        } else if overrides.weights.is_some() && !any_other {
            "--light-weights"
        } else {
            return Ok(());
        };
        Err(SceneError::OverrideUnused {
            file: self.label(),
            option,
            have: list(self.lights.iter().map(|l| l.name.as_str()).enumerate()),
        })
    }

    fn orthographic(&self, name: &str) -> SceneError {
        SceneError::Unsupported {
            file: self.label(),
            element: format!("camera `{}`", shorten(name)),
            what: "an orthographic projection".into(),
            remedy: "choose a perspective camera with --camera",
        }
    }

    /// The number of the item called `asked`, or else of the one with the number `asked`.
    fn find<'a>(
        &self,
        kind: &'static str,
        asked: &str,
        items: impl Iterator<Item = (usize, &'a str)> + Clone,
    ) -> Result<usize, SceneError> {
        let mut named = items.clone().filter(|(_, name)| *name == asked);
        match (named.next(), named.next()) {
            (Some((index, _)), None) => return Ok(index),
            (Some(_), Some(_)) => {
                return Err(SceneError::Ambiguous {
                    file: self.label(),
                    kind,
                    asked: shorten(asked),
                    have: list(items.filter(|(_, name)| *name == asked)),
                });
            }
            (None, _) => {}
        }
        let number = asked.parse().ok();
        items
            .clone()
            .find(|(index, _)| Some(*index) == number)
            .map(|(index, _)| index)
            .ok_or_else(|| SceneError::NotFound {
                file: self.label(),
                kind,
                asked: shorten(asked),
                have: list(items),
            })
    }
}

/// ``0 `sun`, 1 `lamp` ``, cut off after some.
fn list<'a>(items: impl Iterator<Item = (usize, &'a str)>) -> String {
    const SHOWN: usize = 12;
    let mut text = String::new();
    for (at, (index, name)) in items.enumerate() {
        if at == SHOWN {
            text.push_str(", ...");
            break;
        }
        let comma = if at == 0 { "" } else { ", " };
        // Writing to a String cannot fail.
        let _ = write!(text, "{comma}{index} `{}`", shorten(name));
    }
    text
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::light::{AreaLight, LightShape, LightSize, SunAngle};

    fn light(name: &str, shape: LightShape) -> SceneLight {
        SceneLight {
            name: name.into(),
            node: None,
            light: AreaLight::new(shape, Vec3::ZERO, Vec3::NEG_Y, Vec3::X),
        }
    }

    fn scene() -> Scene {
        let sun = LightShape::Sun {
            angular_diameter: 0.01,
        };
        let camera = |name: &str, index| SceneCamera {
            name: name.into(),
            index,
            ..SceneCamera::framing(&super::super::Aabb::EMPTY)
        };
        Scene {
            name: "s".into(),
            lights: vec![
                light("lamp", LightShape::Disk { radius: 1.0 }),
                light("sun", sun),
                light("lamp", LightShape::Disk { radius: 2.0 }),
                light("0", LightShape::Disk { radius: 3.0 }),
            ],
            cameras: vec![camera("front", 0), camera("side", 2)],
            orthographic_cameras: vec![(1, "plan".into())],
            ..Default::default()
        }
    }

    fn message<T: std::fmt::Debug>(result: Result<T, SceneError>) -> String {
        match result {
            Ok(value) => panic!("accepted: {value:?}"),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn lights_by_name_or_index() {
        let scene = scene();
        assert_eq!(scene.select_light(None).ok(), Some(0));
        assert_eq!(scene.select_light(Some("sun")).ok(), Some(1));
        assert_eq!(scene.select_light(Some("2")).ok(), Some(2));
        assert_eq!(scene.select_light(Some("0")).ok(), Some(3));
        assert_eq!(
            message(scene.select_light(Some("lamp"))),
            "s: light `lamp` is ambiguous; use an index: 0 `lamp`, 2 `lamp`"
        );
        assert_eq!(
            message(scene.select_light(Some("4"))),
            "s: no light `4`; the scene has 0 `lamp`, 1 `sun`, 2 `lamp`, 3 `0`"
        );
        assert!(message(scene.select_light(Some("-1"))).contains("no light"));
        assert!(message(Scene::default().select_light(None)).contains("no light"));
    }

    #[test]
    fn cameras_by_name_or_index() {
        let scene = scene();
        let name = |asked| scene.select_camera(asked).map(|camera| camera.name).ok();
        assert_eq!(name(None).as_deref(), Some("front"));
        assert_eq!(name(Some("2")).as_deref(), Some("side"));
        assert_eq!(name(Some("side")).as_deref(), Some("side"));
        assert!(message(scene.select_camera(Some("plan"))).contains("orthographic"));
        assert!(message(scene.select_camera(Some("1"))).contains("orthographic"));
        assert!(message(scene.select_camera(Some("3"))).contains("1 `plan`"));
        let none = Scene::default();
        assert_eq!(
            none.select_camera(None).ok().map(|c| c.name).as_deref(),
            Some("framing")
        );
        assert!(message(none.select_camera(Some("0"))).contains("no camera"));
    }

    #[test]
    fn overrides_reach_the_selected_or_all_of_their_kind() -> Result<(), SceneError> {
        let size = LightOverrides {
            size: Some(LightSize::Single(7.0)),
            ..Default::default()
        };
        let radii = |scene: &Scene| {
            let radius = |l: &SceneLight| l.light.shape.bounding_radius();
            scene.lights.iter().map(radius).collect::<Vec<_>>()
        };
        let mut all = scene();
        all.override_lights(&size, None)?;
        assert_eq!(radii(&all), [7.0, 0.0, 7.0, 7.0]);
        let mut one = scene();
        one.override_lights(&size, Some(2))?;
        assert_eq!(radii(&one), [1.0, 0.0, 7.0, 3.0]);
        let sun = message(scene().override_lights(&size, Some(1)));
        assert!(
            sun.contains("light `sun`") && sun.contains("--sun-angle"),
            "{sun}"
        );
        let angle = LightOverrides {
            sun_angle: Some(SunAngle(0.1)),
            ..Default::default()
        };
        let mut lamps = scene();
        lamps.lights.remove(1);
        let before = lamps.clone();
        let unused = message(lamps.override_lights(&angle, None));
        assert!(unused.contains("--sun-angle fits no light"), "{unused}");
        assert_eq!(lamps, before);
        Ok(())
    }
}
