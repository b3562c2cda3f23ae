//! Reads a shader's interface and the layout of its blocks out of SPIR-V. Shared by the build
//! script and the tests.

use std::collections::HashMap;

use rspirv::binary::{self, Consumer, ParseAction};
use rspirv::dr::{Instruction, ModuleHeader, Operand};
use rspirv::spirv::{BuiltIn, Decoration, Dim, ExecutionMode, Op, StorageClass};

/// Descriptor types, with Vulkan's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Kind {
    Sampler = 0,
    CombinedImageSampler = 1,
    SampledImage = 2,
    StorageImage = 3,
    UniformTexelBuffer = 4,
    StorageTexelBuffer = 5,
    UniformBuffer = 6,
    StorageBuffer = 7,
}

/// A binding of set 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    pub binding: u32,
    pub kind: Kind,
    pub count: u32,
    pub name: String,
}

/// What a pipeline has to know of a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    pub bindings: Vec<Binding>,
    pub push_constant_bytes: u32,
    pub workgroup: [u32; 3],
}

/// The smallest push constant size that every device offers.
const MAX_PUSH_CONSTANT_BYTES: u32 = 128;

/// Keeps the instructions before the first function: all that says something about the interface.
/// The crate's own loader refuses modules whose local size is a specialization constant.
#[derive(Default)]
struct Globals {
    instructions: Vec<Instruction>,
    in_functions: bool,
}

impl Consumer for Globals {
    fn initialize(&mut self) -> ParseAction {
        ParseAction::Continue
    }

    fn finalize(&mut self) -> ParseAction {
        ParseAction::Continue
    }

    fn consume_header(&mut self, _: ModuleHeader) -> ParseAction {
        ParseAction::Continue
    }

    fn consume_instruction(&mut self, instruction: Instruction) -> ParseAction {
        self.in_functions |= instruction.class.opcode == Op::Function;
        if !self.in_functions {
            self.instructions.push(instruction);
        }
        ParseAction::Continue
    }
}

/// A parsed module with its lookup tables.
pub struct Reflection {
    instructions: Vec<Instruction>,
    types: HashMap<u32, Instruction>,
    names: HashMap<u32, String>,
    member_names: HashMap<(u32, u32), String>,
}

fn literal(operand: &Operand) -> Option<u32> {
    match operand {
        Operand::LiteralBit32(value) => Some(*value),
        _ => None,
    }
}

fn id(instruction: &Instruction, operand: usize) -> Option<u32> {
    instruction
        .operands
        .get(operand)
        .and_then(Operand::id_ref_any)
}

impl Reflection {
    /// Parses a module, best one with its names kept.
    pub fn new(words: &[u32]) -> Result<Self, String> {
        let mut globals = Globals::default();
        binary::parse_words(words, &mut globals)
            .map_err(|state| format!("cannot read the SPIR-V: {state}"))?;
        let instructions = globals.instructions;
        let mut names = HashMap::new();
        let mut member_names = HashMap::new();
        for instruction in &instructions {
            match (instruction.class.opcode, &instruction.operands[..]) {
                (Op::Name, [Operand::IdRef(target), Operand::LiteralString(name)]) => {
                    names.insert(*target, name.clone());
                }
                (
                    Op::MemberName,
                    [
                        Operand::IdRef(target),
                        Operand::LiteralBit32(member),
                        Operand::LiteralString(name),
                    ],
                ) => {
                    member_names.insert((*target, *member), name.clone());
                }
                _ => {}
            }
        }
        let types = instructions
            .iter()
            .filter_map(|i| Some((i.result_id?, i.clone())))
            .collect();
        Ok(Self {
            instructions,
            types,
            names,
            member_names,
        })
    }

    fn instruction(&self, id: u32) -> Result<&Instruction, String> {
        self.types
            .get(&id)
            .ok_or_else(|| format!("the SPIR-V uses %{id}, but does not define it"))
    }

    /// Name of an id; empty when it has none.
    pub fn name(&self, id: u32) -> &str {
        self.names.get(&id).map_or("", String::as_str)
    }

    /// Name of a struct's member, or its index.
    pub fn member_name(&self, structure: u32, member: u32) -> String {
        self.member_names
            .get(&(structure, member))
            .cloned()
            .unwrap_or_else(|| member.to_string())
    }

    fn decorated(&self, target: u32, decoration: Decoration) -> bool {
        self.decorations(target, decoration).next().is_some()
    }

    fn decorations(&self, target: u32, decoration: Decoration) -> impl Iterator<Item = &[Operand]> {
        self.instructions
            .iter()
            .filter_map(move |instruction| match &instruction.operands[..] {
                [Operand::IdRef(id), Operand::Decoration(found), rest @ ..]
                    if instruction.class.opcode == Op::Decorate
                        && *id == target
                        && *found == decoration =>
                {
                    Some(rest)
                }
                _ => None,
            })
    }

    fn decoration(&self, target: u32, decoration: Decoration) -> Option<u32> {
        self.decorations(target, decoration)
            .next()
            .and_then(|rest| literal(rest.first()?))
    }

    /// A decoration of a struct's member: the literal after it, 0 when there is none.
    pub fn member_decoration(
        &self,
        structure: u32,
        member: u32,
        decoration: Decoration,
    ) -> Option<u32> {
        self.instructions
            .iter()
            .find_map(|instruction| match &instruction.operands[..] {
                [
                    Operand::IdRef(id),
                    Operand::LiteralBit32(at),
                    Operand::Decoration(found),
                    rest @ ..,
                ] if *id == structure && *at == member && *found == decoration => {
                    Some(rest.first().and_then(literal).unwrap_or(0))
                }
                _ => None,
            })
    }

    /// All struct types with this name, and their member types.
    pub fn structs(&self, name: &str) -> Vec<(u32, Vec<u32>)> {
        let mut found: Vec<_> = self
            .types
            .values()
            .filter(|i| i.class.opcode == Op::TypeStruct)
            .filter_map(|i| i.result_id.map(|id| (id, i)))
            .filter(|(id, _)| self.name(*id) == name)
            .map(|(id, i)| {
                (
                    id,
                    i.operands.iter().filter_map(Operand::id_ref_any).collect(),
                )
            })
            .collect();
        found.sort_unstable();
        found
    }

    /// Strides of the arrays whose elements are of this type.
    pub fn array_strides(&self, element: u32) -> Vec<u32> {
        let mut strides: Vec<u32> = self
            .types
            .values()
            .filter(|i| {
                matches!(i.class.opcode, Op::TypeArray | Op::TypeRuntimeArray)
                    && id(i, 0) == Some(element)
            })
            .filter_map(|i| self.decoration(i.result_id?, Decoration::ArrayStride))
            .collect();
        strides.sort_unstable();
        strides.dedup();
        strides
    }

    /// Value of an integer constant; the default of a specialization constant.
    fn constant(&self, constant: u32) -> Result<u32, String> {
        let instruction = self.instruction(constant)?;
        match (instruction.class.opcode, instruction.operands.first()) {
            (Op::Constant | Op::SpecConstant, Some(Operand::LiteralBit32(value))) => Ok(*value),
            _ => Err(format!(
                "the size `{}` is computed, which is not supported",
                self.name(constant)
            )),
        }
    }

    /// Bytes that a type takes in a block; 0 for a run-time sized array.
    pub fn size(&self, ty: u32) -> Result<u32, String> {
        let instruction = self.instruction(ty)?;
        let operand = |index: usize| {
            instruction
                .operands
                .get(index)
                .and_then(literal)
                .unwrap_or(0)
        };
        let inner = |index: usize| {
            id(instruction, index).ok_or_else(|| format!("type %{ty} is incomplete"))
        };
        match instruction.class.opcode {
            Op::TypeInt | Op::TypeFloat => Ok(operand(0) / 8),
            Op::TypeBool => Ok(4),
            Op::TypePointer => Ok(8),
            Op::TypeVector => Ok(self.size(inner(0)?)? * operand(1)),
            Op::TypeArray => {
                let element = self.size(inner(0)?)?;
                let stride = self
                    .decoration(ty, Decoration::ArrayStride)
                    .unwrap_or(element);
                Ok(stride * self.constant(inner(1)?)?)
            }
            Op::TypeRuntimeArray => Ok(0),
            Op::TypeStruct => {
                let mut end = 0;
                for (member, operand) in (0_u32..).zip(&instruction.operands) {
                    let Some(member_type) = operand.id_ref_any() else {
                        continue;
                    };
                    let offset = self
                        .member_decoration(ty, member, Decoration::Offset)
                        .unwrap_or(end);
                    end = end.max(offset + self.member_size(ty, member, member_type)?);
                }
                Ok(end)
            }
            other => Err(format!("a {other:?} has no size in a block")),
        }
    }

    /// As [`Self::size`] for a member, whose decorations hold the stride of matrices.
    pub fn member_size(&self, structure: u32, member: u32, ty: u32) -> Result<u32, String> {
        let instruction = self.instruction(ty)?;
        match instruction.class.opcode {
            Op::TypeMatrix => {
                let stride = self
                    .member_decoration(structure, member, Decoration::MatrixStride)
                    .unwrap_or(16);
                let columns = instruction.operands.get(1).and_then(literal).unwrap_or(0);
                let column = self.instruction(id(instruction, 0).unwrap_or(0))?;
                let rows = column.operands.get(1).and_then(literal).unwrap_or(0);
                let row_major = self
                    .member_decoration(structure, member, Decoration::RowMajor)
                    .is_some();
                Ok(stride * if row_major { rows } else { columns })
            }
            Op::TypeArray => {
                let inner =
                    id(instruction, 0).ok_or_else(|| format!("type %{ty} is incomplete"))?;
                let count = self.constant(id(instruction, 1).unwrap_or(0))?;
                let stride = match self.decoration(ty, Decoration::ArrayStride) {
                    Some(stride) => stride,
                    None => self.member_size(structure, member, inner)?,
                };
                Ok(stride * count)
            }
            _ => self.size(ty),
        }
    }

    /// Bindings, push constants and local size, or why they are not allowed.
    pub fn interface(&self) -> Result<Interface, String> {
        let entries: Vec<_> = self
            .instructions
            .iter()
            .filter(|i| i.class.opcode == Op::EntryPoint)
            .collect();
        match entries[..] {
            [entry]
                if entry
                    .operands
                    .iter()
                    .any(|o| matches!(o, Operand::LiteralString(name) if name == "main")) => {}
            _ => {
                return Err(format!(
                    "{} entry points; one called `main` is needed",
                    entries.len()
                ));
            }
        }
        let mut bindings: Vec<Binding> = Vec::new();
        let mut push_constant_bytes = 0;
        for variable in &self.instructions {
            let (Op::Variable, Some(variable_id), Some(pointer)) = (
                variable.class.opcode,
                variable.result_id,
                variable.result_type,
            ) else {
                continue;
            };
            let Some(&Operand::StorageClass(class)) = variable.operands.first() else {
                continue;
            };
            let pointee = id(self.instruction(pointer)?, 1).ok_or("a pointer without type")?;
            match class {
                StorageClass::PushConstant => {
                    push_constant_bytes = self.size(pointee)?.next_multiple_of(4)
                }
                StorageClass::UniformConstant
                | StorageClass::Uniform
                | StorageClass::StorageBuffer => {
                    let binding = self.binding(variable_id, class, pointee)?;
                    if let Some(other) = bindings.iter().find(|b| b.binding == binding.binding) {
                        let (number, a, b) = (binding.binding, &other.name, &binding.name);
                        return Err(format!("binding {number} is both `{a}` and `{b}`"));
                    }
                    bindings.push(binding);
                }
                _ => {}
            }
        }
        if push_constant_bytes > MAX_PUSH_CONSTANT_BYTES {
            return Err(format!(
                "{push_constant_bytes} bytes of push constants; devices need not take more than \
                 {MAX_PUSH_CONSTANT_BYTES}, so move the rest into a uniform block"
            ));
        }
        bindings.sort_by_key(|b| b.binding);
        Ok(Interface {
            bindings,
            push_constant_bytes,
            workgroup: self.workgroup()?,
        })
    }

    fn binding(&self, variable: u32, class: StorageClass, pointee: u32) -> Result<Binding, String> {
        let mut ty = self.instruction(pointee)?;
        let mut count = 1;
        while ty.class.opcode == Op::TypeArray {
            count *= self.constant(id(ty, 1).unwrap_or(0))?;
            ty = self.instruction(id(ty, 0).unwrap_or(0))?;
        }
        // A block without instance name is known by the block's name.
        let name = match self.name(variable) {
            "" => self.name(ty.result_id.unwrap_or(0)),
            name => name,
        };
        let set = self
            .decoration(variable, Decoration::DescriptorSet)
            .unwrap_or(0);
        if set != 0 {
            return Err(format!(
                "`{name}` is in set {set}; all bindings belong in set 0"
            ));
        }
        let binding = self
            .decoration(variable, Decoration::Binding)
            .ok_or_else(|| format!("`{name}` has no layout(binding = N)"))?;
        let is_block = |decoration| {
            ty.result_id
                .is_some_and(|id| self.decorated(id, decoration))
        };
        let kind = match (class, ty.class.opcode) {
            (StorageClass::StorageBuffer, Op::TypeStruct) => Kind::StorageBuffer,
            (StorageClass::Uniform, Op::TypeStruct) if is_block(Decoration::BufferBlock) => {
                Kind::StorageBuffer
            }
            (StorageClass::Uniform, Op::TypeStruct) => Kind::UniformBuffer,
            (_, Op::TypeSampler) => Kind::Sampler,
            (_, Op::TypeSampledImage) => {
                let image = self.instruction(id(ty, 0).unwrap_or(0))?;
                match image.operands.get(1) {
                    Some(Operand::Dim(Dim::DimBuffer)) => Kind::UniformTexelBuffer,
                    _ => Kind::CombinedImageSampler,
                }
            }
            (_, Op::TypeImage) => {
                let storage = ty.operands.get(5).and_then(literal) == Some(2);
                match (ty.operands.get(1), storage) {
                    (Some(Operand::Dim(Dim::DimSubpassData)), _) => {
                        return Err(format!(
                            "`{name}` is a subpass input, which dynamic rendering does not have"
                        ));
                    }
                    (Some(Operand::Dim(Dim::DimBuffer)), true) => Kind::StorageTexelBuffer,
                    (Some(Operand::Dim(Dim::DimBuffer)), false) => Kind::UniformTexelBuffer,
                    (_, true) => Kind::StorageImage,
                    (_, false) => Kind::SampledImage,
                }
            }
            (_, Op::TypeRuntimeArray) => {
                return Err(format!("`{name}` is an array without size; give it one"));
            }
            (_, other) => return Err(format!("`{name}` is a {other:?}, which is not supported")),
        };
        Ok(Binding {
            binding,
            kind,
            count,
            name: name.to_owned(),
        })
    }

    fn workgroup(&self) -> Result<[u32; 3], String> {
        // The built-in constant wins over the execution mode.
        for instruction in &self.instructions {
            if let [
                Operand::IdRef(target),
                Operand::Decoration(Decoration::BuiltIn),
                Operand::BuiltIn(BuiltIn::WorkgroupSize),
            ] = instruction.operands[..]
            {
                let parts = &self.instruction(target)?.operands;
                let mut size = [1; 3];
                for (out, part) in size
                    .iter_mut()
                    .zip(parts.iter().filter_map(Operand::id_ref_any))
                {
                    *out = self.constant(part)?;
                }
                return Ok(size);
            }
        }
        for mode in &self.instructions {
            match mode.operands[..] {
                [
                    _,
                    Operand::ExecutionMode(ExecutionMode::LocalSize),
                    Operand::LiteralBit32(x),
                    Operand::LiteralBit32(y),
                    Operand::LiteralBit32(z),
                ] => return Ok([x, y, z]),
                [
                    _,
                    Operand::ExecutionMode(ExecutionMode::LocalSizeId),
                    Operand::IdRef(x),
                    Operand::IdRef(y),
                    Operand::IdRef(z),
                ] => return Ok([self.constant(x)?, self.constant(y)?, self.constant(z)?]),
                _ => {}
            }
        }
        Ok([0; 3])
    }
}
