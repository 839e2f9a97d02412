//! The files of src/ do not import each other in circles, however many files a circle goes through.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::layers::sources;

/// A module or an item, from the root of the crate.
type Path = Vec<String>;

/// What one file declares, hands on from other files, and names of them.
#[derive(Default)]
struct File {
    items: BTreeSet<String>,
    exports: Vec<String>,
    imports: Vec<String>,
}

fn path(text: &str) -> Path {
    text.split("::").filter(|name| !name.is_empty()).map(str::to_owned).collect()
}

/// The rest of a line behind `pub` or `pub(…)`, if there is one.
fn exported(line: &str) -> Option<&str> {
    let rest = line.strip_prefix("pub")?;
    match rest.strip_prefix('(') {
        Some(within) => within.split_once(") ").map(|(_, rest)| rest),
        None => rest.strip_prefix(' '),
    }
}

/// The paths of a tree of imports: `a::{b, c::{d, e}}` has three.
fn paths(tree: &str) -> Vec<String> {
    let Some((head, inside)) = tree.strip_suffix('}').and_then(|tree| tree.split_once('{')) else {
        return tree.split(" as ").take(1).map(|path| path.trim().to_owned()).collect();
    };
    let mut depth = 0;
    let mut is_between = |c: char| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    };
    let parts = inside.split(&mut is_between).map(str::trim).filter(|part| !part.is_empty());
    parts.flat_map(|part| paths(&format!("{head}{part}"))).collect()
}

impl File {
    fn new(text: &str) -> Self {
        const ITEMS: [&str; 7] = ["struct", "enum", "trait", "fn", "const", "type", "static"];
        let mut file = Self::default();
        // The imports of tests are not those of what they test.
        let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
        let mut lines = code.lines().map(str::trim).filter(|line| !line.starts_with("//"));
        while let Some(line) = lines.next() {
            let rest = exported(line).unwrap_or(line);
            if let Some(begin) = rest.strip_prefix("use ") {
                let mut tree = begin.to_owned();
                while !tree.ends_with(';') {
                    tree.push_str(lines.next().expect("an import ends with a semicolon"));
                }
                let found = paths(tree.trim_end_matches(';'));
                if rest == line { &mut file.imports } else { &mut file.exports }.extend(found);
                continue;
            }
            let is_name = |c: char| c.is_alphanumeric() || c == '_';
            let mut words = rest.split(|c: char| !is_name(c)).skip_while(|word| !ITEMS.contains(word));
            file.items.extend(words.nth(1).map(str::to_owned));
            for root in ["crate::", "super::", "self::"] {
                for (at, _) in rest.match_indices(root).filter(|(at, _)| !rest[..*at].ends_with([':', '_'])) {
                    let end =
                        rest[at..].find(|c: char| !is_name(c) && c != ':').map_or(rest.len(), |n| at + n);
                    file.imports.push(rest[at..end].to_owned());
                }
            }
        }
        file
    }
}

/// A path as it is written in a module, from the root of the crate; none for a path into another crate.
fn absolute(files: &BTreeMap<Path, File>, module: &Path, written: &str) -> Option<Path> {
    let mut names = path(written);
    let mut base = module.clone();
    match names.first()?.as_str() {
        "crate" => return Some(names.split_off(1)),
        "self" => names = names.split_off(1),
        "super" => {
            while names.first().is_some_and(|name| name == "super") {
                (_, names) = (base.pop(), names.split_off(1));
            }
        }
        child if files.contains_key(&[&module[..], &[child.to_owned()]].concat()) => (),
        _ => return None,
    }
    Some([base, names].concat())
}

/// The file that declares what a path leads to, also where another file hands it on.
fn declared_in(files: &BTreeMap<Path, File>, path: &Path, depth: usize) -> Option<Path> {
    let module =
        (0..=path.len()).rev().map(|len| path[..len].to_vec()).find(|path| files.contains_key(path))?;
    let (file, item) = (&files[&module], path.get(module.len()));
    let Some(item) = item.filter(|item| depth < 8 && !file.items.contains(*item)) else {
        return Some(module);
    };
    let exports = file.exports.iter().filter_map(|export| absolute(files, &module, export));
    let leads = exports.filter_map(|mut export| match export.pop()? {
        last if last == *item || last == "*" => Some([export, vec![item.clone()]].concat()),
        _ => None,
    });
    let found = leads.filter_map(|path| declared_in(files, &path, depth + 1)).next();
    Some(found.unwrap_or(module))
}

/// Groups of files each of which imports all the others, by way of files between.
fn circles(texts: &[(String, String)]) -> BTreeSet<Vec<String>> {
    let files: BTreeMap<Path, File> =
        texts.iter().map(|(name, text)| (path(name), File::new(text))).collect();
    let imports = |module: &Path| -> BTreeSet<Path> {
        let written = files[module].imports.iter().filter_map(|written| absolute(&files, module, written));
        let found = written.filter_map(|path| declared_in(&files, &path, 0));
        found.filter(|other| other != module).collect()
    };
    let imports: BTreeMap<&Path, BTreeSet<Path>> = files.keys().map(|file| (file, imports(file))).collect();
    let reached = |from: &Path| {
        let (mut reached, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(next) = open.pop() {
            open.extend(imports[next].iter().filter(|&other| reached.insert(other.clone())));
        }
        reached
    };
    let reached: BTreeMap<&Path, BTreeSet<Path>> = files.keys().map(|file| (file, reached(file))).collect();
    let round = |file: &Path| -> Vec<String> {
        let others = reached[file].iter().filter(|other| reached[other].contains(file));
        others.map(|path| path.join("::")).collect()
    };
    files.keys().map(round).filter(|circle| !circle.is_empty()).collect()
}

/// Every file of src/ that is not only tests, by its module.
fn modules() -> Vec<(String, String)> {
    let root = crate::root().join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let names = files.into_iter().map(|file| {
        let name = file.strip_prefix(&root).unwrap().with_extension("");
        let mut names: Vec<_> = name.iter().map(|name| name.to_string_lossy().into_owned()).collect();
        if names.last().is_some_and(|name| name == "mod" || names.len() == 1 && name == "lib") {
            names.pop();
        }
        (names, file)
    });
    let library = names.filter(|(names, _)| *names != ["main"] && !names.contains(&"tests".to_owned()));
    library.map(|(names, file)| (names.join("::"), fs::read_to_string(file).unwrap())).collect()
}

#[test]
fn no_file_imports_itself_by_way_of_others() {
    let modules = modules();
    assert!(modules.len() > 100);
    let found = circles(&modules);
    let lines: Vec<String> = found.iter().map(|circle| circle.join(", ")).collect();
    assert!(found.is_empty(), "these files import each other:\n{}", lines.join("\n"));
}

#[test]
fn files_that_import_each_other_are_noticed() {
    let made_up = |files: &[(&str, &str)]| {
        let texts = files.iter().map(|&(name, text)| (name.to_owned(), text.to_owned()));
        circles(&texts.collect::<Vec<_>>())
    };
    let two = [("a", "use crate::b::B;\nstruct A;"), ("b", "struct B(\n    super::a::A,\n);")];
    assert_eq!(made_up(&two), BTreeSet::from([vec!["a".to_owned(), "b".to_owned()]]));
    // What a folder hands on is declared in the file below it.
    let folder = ("c", "mod d;\nmod e;\npub use self::{d::D, e::{E, F}};");
    let [d, e] = [("c::d", "use super::E;\npub struct D;"), ("c::e", "pub struct E;")];
    assert!(made_up(&[folder, d, e]).is_empty());
    let back = (
        "c::e",
        "use std::{\n    fs,\n    io::{Read, Write},\n};\nuse crate::c::{\n    D,\n};\npub struct E;",
    );
    assert_eq!(made_up(&[folder, d, back]).len(), 1);
    assert!(
        made_up(&[folder, ("c::d", "use super::E;\n#[cfg(test)]\nmod tests {\nuse crate::x;\n}"), e])
            .is_empty()
    );
}
