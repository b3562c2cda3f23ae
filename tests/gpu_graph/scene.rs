//! Small graphs that do real work, recorded as planned and then with a mistake in their plan.

use antumbra::ash::vk;
use antumbra::gpu::{Gpu, GpuError};
use antumbra::graph::simulate::{Problem, simulate};
use antumbra::graph::{
    Access, Barrier, Batch, BufferDesc, BufferId, BufferPart, FrameCache, Graph, ImageDesc,
    ImageId, ImagePart, Load, PassKind, Plan, Stage,
};

use crate::layer::assert_current_layer;
use crate::random_graph::{Used, texel};
use crate::support::{assert_no_messages, destroy_clean, gpu, serial};
use crate::work::World;

/// A resource of a scene, in its newest version.
#[derive(Clone, Copy)]
pub enum Res {
    Image(ImageId, ImageDesc, usize),
    Buffer(BufferId, u64, usize),
}

impl Res {
    fn used(&self, access: Access) -> Used {
        match *self {
            Res::Image(id, desc, tag) => Used::Image {
                id,
                desc,
                part: ImagePart::whole(&desc),
                access,
                tag,
            },
            Res::Buffer(id, size, tag) => Used::Buffer {
                id,
                part: part(access, size),
                access,
                tag,
            },
        }
    }
}

/// What of a buffer is used: all, or the arguments of a draw.
fn part(access: Access, size: u64) -> BufferPart {
    let size = if access == Access::Indirect { 16 } else { size };
    BufferPart { offset: 0, size }
}

/// A graph of a few passes that do real work.
pub struct Scene<'w> {
    graph: Graph<'w>,
    world: &'w World,
    resources: usize,
}

impl<'w> Scene<'w> {
    pub fn image(&mut self, name: &'static str) -> Res {
        self.image_of(name, vk::Format::R32_SFLOAT)
    }

    pub fn image_of(&mut self, name: &'static str, format: vk::Format) -> Res {
        let desc = ImageDesc::new(format, 16, 16);
        self.resources += 1;
        Res::Image(self.graph.create_image(name, desc), desc, self.resources)
    }

    pub fn buffer(&mut self, name: &'static str) -> Res {
        let size = 1024;
        self.resources += 1;
        let id = self.graph.create_buffer(name, BufferDesc { size });
        Res::Buffer(id, size, self.resources)
    }

    pub fn pass(&mut self, name: &'static str, kind: PassKind, uses: &mut [(&mut Res, Access)]) {
        let mut pass = self.graph.pass(name, kind);
        let mut declared = Vec::new();
        for (resource, access) in uses.iter_mut() {
            let access = *access;
            match resource {
                Res::Image(id, _, tag) => {
                    let clear = Load::Clear([texel(*tag); 4]);
                    match access {
                        Access::ColorAttachment => *id = pass.color(*id, clear),
                        Access::ColorAttachmentLoad => *id = pass.color(*id, Load::Keep),
                        Access::DepthAttachment => *id = pass.depth(*id, clear),
                        Access::DepthAttachmentLoad => *id = pass.depth(*id, Load::Keep),
                        Access::DepthTest => pass.depth_test(*id),
                        _ if !access.writes() => pass.read(*id, access),
                        _ if access.reads() => *id = pass.write(*id, access),
                        _ => *id = pass.overwrite(*id, access),
                    }
                }
                Res::Buffer(id, size, _) => {
                    let part = part(access, *size);
                    if !access.writes() {
                        pass.read_part(*id, part, access);
                    } else if access.reads() {
                        *id = pass.write_part(*id, part, access);
                    } else {
                        *id = pass.overwrite_part(*id, part, access);
                    }
                }
            }
            declared.push(resource.used(access));
        }
        let world = self.world;
        pass.record(move |context| world.work(context, kind, &declared));
    }

    /// Makes resources results of the frame, whose contents are checked.
    pub fn results(&mut self, resources: &[Res]) {
        let reads = resources.iter().map(|resource| match resource {
            Res::Image(..) => resource.used(Access::Sampled(Stage::Compute)),
            Res::Buffer(..) => resource.used(Access::StorageRead(Stage::Compute)),
        });
        self.world
            .judge(&mut self.graph, &reads.collect::<Vec<_>>());
    }
}

/// Records one frame of a scene, with its plan changed; returns what the simulator and the layer
/// say.
fn record(
    gpu: &mut Gpu,
    world: &mut World,
    build: impl Fn(&mut Scene<'_>),
    edit: impl FnOnce(&mut Plan),
) -> (Vec<Problem>, Vec<String>) {
    world.begin_frame();
    let mut scene = Scene {
        graph: Graph::new(),
        world,
        resources: 0,
    };
    build(&mut scene);
    let mut compiled = scene.graph.compile(&*gpu).unwrap();
    compiled.edit_plan(edit);
    let hazards = simulate(compiled.plan())
        .into_iter()
        .map(|h| h.problem)
        .collect();
    let mut cache = FrameCache::new();
    gpu.run(|gpu, cmd| {
        compiled.record(gpu, &mut cache, cmd)?;
        world.end_frame(gpu, cmd);
        Ok::<_, GpuError>(())
    })
    .unwrap();
    cache.destroy(gpu);
    let messages = gpu.take_messages().into_iter().map(|message| message.id);
    (hazards, messages.collect())
}

/// Records the scene as it was planned, which must be silent, and then with the mistake, which
/// must be reported by the layer under one of these ids and by the simulator as this problem.
#[track_caller]
pub fn plant(
    mistake: &str,
    build: impl Fn(&mut Scene<'_>),
    edit: impl FnOnce(&mut Plan),
    id: &str,
    problem: impl Fn(&Problem) -> bool,
) {
    let _one = serial();
    assert_current_layer();
    let mut gpu = gpu();
    let mut world = World::new(&mut gpu);
    let (problems, messages) = record(&mut gpu, &mut world, &build, |_| {});
    assert_eq!(
        (problems, messages),
        (vec![], vec![]),
        "{mistake}: the plan without it"
    );
    assert!(world.check(mistake) > 0);

    let (problems, mut messages) = record(&mut gpu, &mut world, &build, edit);
    messages.sort();
    messages.dedup();
    println!("{mistake:<58} | {problems:?} | {}", messages.join(", "));
    world.destroy(&mut gpu);
    assert_no_messages(&gpu.take_messages());
    destroy_clean(gpu);
    assert!(
        messages.iter().any(|found| found.contains(id)),
        "{mistake}: {messages:?}"
    );
    assert!(problems.iter().any(problem), "{mistake}: {problems:?}");
}

/// The barriers in front of a pass.
pub fn batch<'p>(plan: &'p mut Plan, pass: &str) -> &'p mut Batch {
    let Plan { passes, steps, .. } = plan;
    let step = steps
        .iter_mut()
        .find(|step| step.passes.iter().any(|index| passes[*index].name == pass));
    &mut step.unwrap().barriers
}

/// The one barrier on a resource in front of a pass.
pub fn barrier<'p>(plan: &'p mut Plan, pass: &str, resource: &str) -> &'p mut Barrier {
    let index = plan.resources.iter().position(|r| r.name == resource);
    let found = batch(plan, pass).barriers.iter_mut();
    let mut found = found.filter(|b| b.target.map(|(resource, _)| resource) == index);
    let only = found.next().expect("a barrier to spoil");
    assert!(found.next().is_none());
    only
}

/// Takes the one barrier on a resource in front of a pass away.
pub fn drop_barrier(plan: &mut Plan, pass: &str, resource: &str) {
    let gone = *barrier(plan, pass, resource);
    batch(plan, pass)
        .barriers
        .retain(|barrier| *barrier != gone);
}
