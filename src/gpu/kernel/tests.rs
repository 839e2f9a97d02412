use std::mem::offset_of;

use wgpu::naga;

use super::super::layout;
use super::*;

fn module(kernel: Kernel) -> Result<naga::Module, String> {
    valid(&format!("{kernel:?}"), &kernel.source())
}

fn valid(name: &str, source: &str) -> Result<naga::Module, String> {
    let named = |error: String| format!("{name}: {error}");
    let module = naga::front::wgsl::parse_str(source).map_err(|error| named(error.emit_to_string(source)))?;
    let capabilities = naga::valid::Capabilities::SHADER_FLOAT32_ATOMIC;
    naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|error| named(error.emit_to_string(source)))?;
    Ok(module)
}

#[test]
fn every_kernel_is_valid_as_it_is_assembled() {
    let all = Kernel::all();
    let mut failures: Vec<String> = all.iter().filter_map(|&kernel| module(kernel).err()).collect();
    failures.extend(valid("surfaces", super::super::surfaces::SURFACES).err());
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(all.len() > 100);
}

#[test]
fn bindings_are_those_of_the_kernel() {
    use naga::{AddressSpace, StorageAccess};
    for kernel in Kernel::all() {
        let module = module(kernel).unwrap();
        let mut found = 0;
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else { continue };
            found += 1;
            let access = kernel.bindings()[binding.group as usize][binding.binding as usize];
            let fits = match variable.space {
                AddressSpace::Uniform => matches!(access, Access::Parameters | Access::Uniform),
                AddressSpace::Storage { access: StorageAccess::LOAD } => access == Access::Read,
                AddressSpace::Storage { .. } => access == Access::Write,
                _ => false,
            };
            assert!(fits, "{kernel:?}: {variable:?} is bound as {access:?}");
        }
        assert_eq!(found, kernel.bindings().concat().len(), "{kernel:?}");
    }
}

/// Functions that store to a component of a vector by a number which is not constant.
fn dynamic_stores(module: &naga::Module) -> Vec<String> {
    use naga::{Expression, Statement, TypeInner};
    fn stored(block: &naga::Block, pointers: &mut Vec<naga::Handle<Expression>>) {
        for statement in block {
            match statement {
                Statement::Store { pointer, .. } => pointers.push(*pointer),
                Statement::Block(inner) => stored(inner, pointers),
                Statement::If { accept, reject, .. } => {
                    [accept, reject].into_iter().for_each(|b| stored(b, pointers))
                }
                Statement::Switch { cases, .. } => cases.iter().for_each(|case| stored(&case.body, pointers)),
                Statement::Loop { body, continuing, .. } => {
                    [body, continuing].into_iter().for_each(|b| stored(b, pointers))
                }
                _ => {}
            }
        }
    }
    /// What a pointer points to.
    fn pointee<'a>(
        module: &'a naga::Module,
        function: &'a naga::Function,
        of: naga::Handle<Expression>,
    ) -> Option<&'a TypeInner> {
        let inner = |ty: naga::Handle<naga::Type>| Some(&module.types[ty].inner);
        match &function.expressions[of] {
            Expression::LocalVariable(variable) => inner(function.local_variables[*variable].ty),
            Expression::GlobalVariable(variable) => inner(module.global_variables[*variable].ty),
            Expression::FunctionArgument(index) => match inner(function.arguments[*index as usize].ty)? {
                TypeInner::Pointer { base, .. } => inner(*base),
                _ => None,
            },
            Expression::AccessIndex { base, index } => match pointee(module, function, *base)? {
                TypeInner::Struct { members, .. } => inner(members[*index as usize].ty),
                TypeInner::Array { base, .. } => inner(*base),
                _ => None,
            },
            Expression::Access { base, .. } => match pointee(module, function, *base)? {
                TypeInner::Array { base, .. } => inner(*base),
                _ => None,
            },
            _ => None,
        }
    }
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    let mut found = Vec::new();
    for function in module.functions.iter().map(|(_, function)| function).chain(entries) {
        let mut pointers = Vec::new();
        stored(&function.body, &mut pointers);
        let is_dynamic = |pointer: &naga::Handle<Expression>| match function.expressions[*pointer] {
            Expression::Access { base, .. } => {
                matches!(pointee(module, function, base), Some(TypeInner::Vector { .. }))
            }
            _ => false,
        };
        if pointers.iter().any(is_dynamic) {
            found.push(function.name.clone().unwrap_or_else(|| "main".to_owned()));
        }
    }
    found
}

/// FXC, which DX12 has where DXC is not installed, refuses them in loops that it cannot unroll.
#[test]
fn no_kernel_stores_to_a_component_by_a_number_that_is_not_constant() {
    let mut found: Vec<(&str, String)> = Vec::new();
    for kernel in Kernel::all() {
        let of = dynamic_stores(&module(kernel).unwrap());
        found.extend(of.into_iter().map(|function| (kernel.name(), function)));
    }
    found.sort();
    found.dedup();
    assert!(found.is_empty(), "{found:?}");
    let by_number = |store: &str| {
        let text = format!(
            "@compute @workgroup_size(1) fn main(@builtin(local_invocation_index) i: u32) {{ var v = vec3(0.0); {store} = 1.0; }}"
        );
        dynamic_stores(&valid("twin", &text).unwrap()).len()
    };
    assert_eq!(["v[i]", "v[1]", "v.y"].map(by_number), [1, 0, 0]);
}

#[test]
fn no_kernel_binds_more_storage_buffers_than_an_adapter_is_asked_for() {
    let storage = |access: &&Access| matches!(access, Access::Read | Access::Write);
    let bound = |kernel: Kernel| kernel.bindings().concat().iter().filter(storage).count() as u32;
    assert_eq!(Kernel::all().into_iter().map(bound).max(), Some(super::super::adapter::STORAGE_BUFFERS));
}

/// The members of a struct in WGSL: name, offset; and its size.
fn members(kernel: Kernel, name: &str) -> (Vec<(String, usize)>, usize) {
    let module = module(kernel).unwrap();
    for (_, of) in module.types.iter() {
        if let (Some(found), naga::TypeInner::Struct { members, span }) = (&of.name, &of.inner)
            && found == name
        {
            let member = |member: &naga::StructMember| (member.name.clone().unwrap(), member.offset as usize);
            return (members.iter().map(member).collect(), *span as usize);
        }
    }
    panic!("no struct {name}");
}

macro_rules! same_layout {
    ($kernel:expr, $name:literal, $rust:ty, [$($member:ident),*]) => {
        let expected = vec![$((stringify!($member).to_owned(), offset_of!($rust, $member))),*];
        assert_eq!(members($kernel, $name), (expected, size_of::<$rust>()), $name);
    };
}

#[test]
fn members_lie_where_the_kernels_look_for_them() {
    let walk = Walk { bilinear: true, march: false, colored: false, channels: 3, near: false };
    let gather = Kernel::LightMap(Consumer::Gather, walk);
    for kernel in [Kernel::Axpby, Kernel::Dot] {
        same_layout!(
            kernel,
            "VectorParams",
            layout::VectorParams,
            [
                len,
                stride,
                channel,
                other_first,
                other_len,
                other_stride,
                again,
                results,
                first,
                pad0,
                pad1,
                pad2,
                a,
                b
            ]
        );
    }
    same_layout!(
        gather,
        "Transport",
        layout::Transport,
        [sigma_t, light_size, shadow_size, shadow_top, steps, pad, levels]
    );
    same_layout!(
        gather,
        "Ray",
        layout::Ray,
        [
            strength,
            entry_cell,
            entry_fraction,
            first_high,
            first_low,
            step_high,
            step_low,
            slope,
            shadow_clip,
            shadow_cell,
            shadow_first_high,
            shadow_first_low,
            shadow_step_high,
            shadow_step_low,
            depth_window,
            depth,
            depth_step_high,
            depth_step_low,
            depth_slope,
            length,
            before,
            pad
        ]
    );
    same_layout!(
        gather,
        "Pass",
        layout::Pass,
        [rows, y_first, y_stride, channel, x_first, x_len, x_stride, pad]
    );
    let walk = VolumeWalk {
        extinction: false,
        lit: true,
        nested: true,
        trilinear: true,
        colored: false,
        channels: 3,
    };
    let volume = Kernel::Volume(Consumer::Gather, walk);
    same_layout!(volume, "Track", layout::Track, [first, step_high, step_low, entry]);
    same_layout!(volume, "Light", layout::Light, [high, low, at_high, slots, at_low, first, size, channels]);
    same_layout!(
        volume,
        "Volume",
        layout::Volume,
        [metres, cells, slots, size, elements, transmittance_bound, channels, lights, pad, light]
    );
    same_layout!(
        volume,
        "Pass",
        layout::Pass,
        [rows, y_first, y_stride, channel, x_first, x_len, x_stride, pad]
    );
    same_layout!(Kernel::FixedScale, "Scale", layout::Scale, [begin, pieces, row_sums]);
    let rows = Kernel::Rows { colored: false, channels: 3, squared: false, sharers: 8 };
    same_layout!(
        rows,
        "Rows",
        layout::Rows,
        [rows, y_first, y_stride, channel, x_stride, nonzeros, pad0, pad1]
    );
    let tiles = Kernel::Tiles { colored: false, channels: 3, operation: TileOperation::Descend };
    same_layout!(tiles, "Tiles", layout::Tiles, [tiles, stride, channel, parts, shorter]);
    same_layout!(tiles, "Part", layout::Part, [lower, upper, begin, pad0, pad1, pad2]);
}
