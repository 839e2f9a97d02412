use std::collections::BTreeSet;

use wgpu::naga;

use super::layout::LAYOUTS;
use super::*;

fn module(program: Program) -> Result<naga::Module, String> {
    valid(&format!("{program:?}"), &program.source())
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
    let all = Program::all();
    let mut failures: Vec<String> = all.iter().filter_map(|&program| module(program).err()).collect();
    failures.extend(valid("surfaces", SURFACES).err());
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(all.len() > 100);
}

#[test]
fn bindings_are_those_of_the_kernel() {
    use naga::{AddressSpace, StorageAccess};
    for program in Program::all() {
        let module = module(program).unwrap();
        let mut found = 0;
        for (_, variable) in module.global_variables.iter() {
            let Some(binding) = &variable.binding else { continue };
            found += 1;
            let access = program.bindings()[binding.group as usize][binding.binding as usize];
            let fits = match variable.space {
                AddressSpace::Uniform => matches!(access, Access::Parameters | Access::Uniform),
                AddressSpace::Storage { access: StorageAccess::LOAD } => access == Access::Read,
                AddressSpace::Storage { .. } => access == Access::Write,
                _ => false,
            };
            assert!(fits, "{program:?}: {variable:?} is bound as {access:?}");
        }
        assert_eq!(found, program.bindings().concat().len(), "{program:?}");
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
    for program in Program::all() {
        let of = dynamic_stores(&module(program).unwrap());
        found.extend(of.into_iter().map(|function| (program.name(), function)));
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
    let bound = |program: Program| program.bindings().concat().iter().filter(storage).count() as u32;
    assert_eq!(Program::all().into_iter().map(bound).max(), Some(STORAGE_BUFFERS));
}

/// A struct of a module: name, size, and the offset of every member.
type Layout = (String, usize, Vec<(String, usize)>);

fn layouts(module: &naga::Module) -> Vec<Layout> {
    let layout = |of: &naga::Type| match (&of.name, &of.inner) {
        (Some(name), naga::TypeInner::Struct { members, span }) => {
            let member = |member: &naga::StructMember| (member.name.clone().unwrap(), member.offset as usize);
            Some((name.clone(), *span as usize, members.iter().map(member).collect()))
        }
        _ => None,
    };
    module.types.iter().filter_map(|(_, of)| layout(of)).collect()
}

#[test]
fn members_lie_where_the_kernels_look_for_them() {
    let mut met = BTreeSet::new();
    for program in Program::all() {
        for (name, size, members) in layouts(&module(program).unwrap()) {
            // What is in none of the buffers has no namesake.
            let Some((known, bytes, offsets)) = LAYOUTS.iter().find(|(known, ..)| *known == name) else {
                continue;
            };
            let here: Vec<_> = members.iter().map(|(name, offset)| (&name[..], *offset)).collect();
            assert_eq!((&here[..], size), (*offsets, *bytes), "{name} in {program:?}");
            met.insert(*known);
        }
    }
    assert_eq!(met, LAYOUTS.iter().map(|(name, ..)| *name).collect());
}

#[test]
fn every_struct_of_a_buffer_has_its_namesake() {
    let in_buffers = |module: &naga::Module| -> Vec<String> {
        let named = |ty: naga::Handle<naga::Type>| {
            let ty = match module.types[ty].inner {
                naga::TypeInner::Array { base, .. } => base,
                _ => ty,
            };
            match &module.types[ty] {
                naga::Type { name: Some(name), inner: naga::TypeInner::Struct { .. } } => Some(name.clone()),
                _ => None,
            }
        };
        let bound = module.global_variables.iter().filter(|(_, variable)| variable.binding.is_some());
        bound.filter_map(|(_, variable)| named(variable.ty)).collect()
    };
    let has_namesake = |name: &String| LAYOUTS.iter().any(|(known, ..)| known == name);
    for program in Program::all() {
        let names = in_buffers(&module(program).unwrap());
        assert!(names.iter().all(has_namesake), "{program:?}: {names:?}");
    }
    let stranger = "struct Stranger { a: u32 } @group(0) @binding(0) var<uniform> s: Stranger;";
    assert!(!in_buffers(&valid("twin", stranger).unwrap()).iter().all(has_namesake));
}
