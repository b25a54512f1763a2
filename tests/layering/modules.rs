//! Imports between the modules of a package, read from its files.
//!
//! An import is a path to another module's item, in a `use` or in the code; a name that a module
//! passes on leads to the module that defines the name. A call of a method names no module and is
//! not seen.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    path::Path,
};

use crate::tokens::tokens;

/// Names of the modules that lead to a module or an item, from the root of the package.
type Names = Vec<String>;

/// Modules of a package by their paths; the root has the empty path.
#[derive(Default)]
pub(crate) struct Package(BTreeMap<Names, Module>);

/// A file, or a module in braces inside of one.
#[derive(Default)]
struct Module {
    file: String,
    /// Path of the file's own module.
    home: Names,
    children: BTreeSet<String>,
    items: BTreeSet<String>,
    uses: Vec<Use>,
    /// Paths outside of `use`, with the paths of a single name.
    paths: BTreeSet<Names>,
}

/// A leaf of a `use`: `self::b::{C, d::*}` has two.
struct Use {
    path: Names,
    /// The name in the module; `*` for all that the path holds.
    name: String,
    public: bool,
}

/// Destination of a path.
enum Place {
    Module(Names),
    /// A module and the name of its item.
    Item(Names, String),
}

/// An import of one file from another.
pub(crate) struct Import {
    /// The module of the file that imports.
    pub(crate) by: Names,
    /// The module of the file that defines what is imported.
    pub(crate) from: Names,
    /// The files and the names, for messages.
    pub(crate) text: String,
}

impl Package {
    /// Adds a file, whose path counts from `src`.
    pub(crate) fn add(&mut self, file: &str, text: &str) {
        let path = Path::new(file).with_extension("");
        let mut home: Names = path.iter().map(|name| name.to_string_lossy().into()).collect();
        home.pop_if(|last| matches!(last.as_str(), "lib" | "main" | "mod"));
        let module = || Module { file: file.to_owned(), home: home.clone(), ..Module::default() };
        let tokens = tokens(text);
        let token = |at: usize| tokens.get(at).copied().unwrap_or_default();
        // Modules that enclose the present token, each with the depth of its braces.
        let mut open = vec![(home.clone(), 0, module())];
        let mut depth = 0;
        let mut at = 0;
        while at < tokens.len() {
            let (path, inside, here) = open.last_mut().expect("the file itself is never closed");
            let before = if at > 0 { token(at - 1) } else { "" };
            match token(at) {
                "mod" if matches!(token(at + 2), "{" | ";") => {
                    let name = token(at + 1).to_owned();
                    here.children.insert(name.clone());
                    if token(at + 2) == "{" {
                        depth += 1;
                        let path = path.iter().cloned().chain([name]).collect();
                        open.push((path, depth, module()));
                    }
                    at += 2;
                }
                "use" if token(at + 1) != "<" => {
                    let length = tokens[at..].iter().take_while(|token| **token != ";").count();
                    let public = matches!(before, "pub" | ")");
                    let leaves = leaves(&tokens[at + 1..at + length]).into_iter();
                    here.uses.extend(leaves.map(|(path, name)| Use { path, name, public }));
                    at += length;
                }
                "{" => depth += 1,
                "}" => {
                    // The file's own depth is 0, which no brace closes.
                    if depth == *inside
                        && let Some((path, _, module)) = open.pop()
                    {
                        self.insert(path, module);
                    }
                    depth -= 1;
                }
                first if is_name(first) && !matches!(before, "::" | ".") => {
                    const ITEMS: [&str; 7] =
                        ["const", "enum", "fn", "static", "struct", "trait", "type"];
                    if depth == *inside && ITEMS.contains(&first) {
                        here.items.insert(token(at + 1).to_owned());
                    }
                    let mut path = vec![first.to_owned()];
                    while token(at + 1) == "::" && is_name(token(at + 2)) {
                        path.push(token(at + 2).to_owned());
                        at += 2;
                    }
                    here.paths.insert(path);
                }
                _ => {}
            }
            at += 1;
        }
        open.into_iter().for_each(|(path, _, module)| self.insert(path, module));
    }

    /// Inserts a module; one that is there already, for other features, has both contents.
    fn insert(&mut self, path: Names, module: Module) {
        let there = self.0.entry(path).or_default();
        there.file = module.file;
        there.home = module.home;
        there.children.extend(module.children);
        there.items.extend(module.items);
        there.uses.extend(module.uses);
        there.paths.extend(module.paths);
    }

    /// Returns the imports between files. A parent that passes on a name of a module below it does
    /// not import that name, unless its own code has it.
    pub(crate) fn imports(&self) -> Vec<Import> {
        let mut names: BTreeMap<(&Names, &Names), BTreeSet<String>> = BTreeMap::new();
        for (path, module) in self.0.iter().filter(|(path, _)| self.is_declared(path)) {
            let used = module.uses.iter().filter(|leaf| leaf.name != "*");
            let used = used.map(|leaf| (&leaf.path, leaf.public));
            for (to, public) in used.chain(module.paths.iter().map(|path| (path, false))) {
                let Some(Place::Item(owner, name)) = self.resolve(path, to, &mut Vec::new()) else {
                    continue;
                };
                let owner = &self.0[&owner].home;
                if *owner != module.home && !(public && owner.starts_with(&module.home)) {
                    names.entry((&module.home, owner)).or_default().insert(name);
                }
            }
        }
        let import = |((by, from), names): ((&Names, &Names), BTreeSet<String>)| {
            let names: Vec<String> = names.into_iter().collect();
            let importer = &self.0[by].file;
            let owner = &self.0[from].file;
            let text = format!("{importer} imports {} of {owner}", names.join(", "));
            Import { by: by.clone(), from: from.clone(), text }
        };
        names.into_iter().map(import).collect()
    }

    /// Returns the circles of imports, between files and between whole folders: at each depth a
    /// folder of that depth counts as one module.
    pub(crate) fn circles(&self) -> BTreeSet<String> {
        let imports = self.imports();
        let mut found = BTreeSet::new();
        for depth in 1..=self.0.keys().map(Vec::len).max().unwrap_or(0) {
            let mut edges: BTreeMap<&[String], BTreeMap<&[String], Vec<&str>>> = BTreeMap::new();
            for Import { by, from, text } in &imports {
                let by = &by[..depth.min(by.len())];
                let from = &from[..depth.min(from.len())];
                if by != from {
                    edges.entry(by).or_default().entry(from).or_default().push(text);
                }
            }
            for module in edges.keys() {
                found.extend(shortest_circle(&edges, module));
            }
        }
        found
    }

    /// Returns true if every module on the way declares the next one: modules of tests are declared
    /// for tests alone.
    fn is_declared(&self, path: &[String]) -> bool {
        let declares = |(parent, name): (&[String], &String)| {
            self.0.get(parent).is_some_and(|parent| parent.children.contains(name))
        };
        (0..path.len()).map(|length| (&path[..length], &path[length])).all(declares)
    }

    /// Returns the destination of a path in a module; `None` for a path out of the package.
    /// `pending` are the names that are being looked up: one may lead back to itself.
    fn resolve(
        &self,
        module: &[String],
        path: &[String],
        pending: &mut Vec<(Names, String)>,
    ) -> Option<Place> {
        let (first, rest) = path.split_first()?;
        let mut place = match first.as_str() {
            "crate" => Place::Module(Vec::new()),
            "self" => Place::Module(module.to_vec()),
            "super" => Place::Module(module.split_last()?.1.to_vec()),
            _ => self.look_up(module, first, rest.is_empty(), pending)?,
        };
        for (at, name) in rest.iter().enumerate() {
            let Place::Module(module) = place else { return Some(place) };
            place = if name == "super" {
                Place::Module(module.split_last()?.1.to_vec())
            } else {
                let is_last = at + 1 == rest.len();
                let found = self.look_up(&module, name, is_last, pending);
                found.unwrap_or(Place::Item(module, name.clone()))
            };
        }
        Some(place)
    }

    /// Returns the destination of a name in a module. Where a module and an item have one name, the
    /// last name of a path is the item.
    fn look_up(
        &self,
        module: &[String],
        name: &str,
        is_last: bool,
        pending: &mut Vec<(Names, String)>,
    ) -> Option<Place> {
        let here = self.0.get(module)?;
        let child: Names = module.iter().cloned().chain([name.to_owned()]).collect();
        let is_child = here.children.contains(name) && self.0.contains_key(&child);
        if is_child && !is_last {
            return Some(Place::Module(child));
        }
        let key = (module.to_vec(), name.to_owned());
        if pending.contains(&key) {
            return None;
        }
        pending.push(key);
        let named = here.uses.iter().find(|leaf| leaf.name == name);
        let mut found = named.and_then(|leaf| self.resolve(module, &leaf.path, pending));
        if found.is_none() && is_child {
            found = Some(Place::Module(child));
        }
        if found.is_none() && here.items.contains(name) {
            found = Some(Place::Item(module.to_vec(), name.to_owned()));
        }
        for glob in here.uses.iter().filter(|leaf| leaf.name == "*") {
            if found.is_none()
                && let Some(Place::Module(module)) = self.resolve(module, &glob.path, pending)
            {
                found = self.look_up(&module, name, is_last, pending);
            }
        }
        pending.pop();
        found
    }
}

/// Returns the imports along the shortest way from a module back to itself.
fn shortest_circle(
    edges: &BTreeMap<&[String], BTreeMap<&[String], Vec<&str>>>,
    module: &[String],
) -> Option<String> {
    let mut ways = VecDeque::from([vec![module]]);
    let mut reached = BTreeSet::new();
    while let Some(way) = ways.pop_front() {
        let last = way.last().expect("a way has a module");
        for next in edges.get(last).into_iter().flat_map(BTreeMap::keys) {
            if *next == module {
                let nexts = way.iter().skip(1).chain([next]);
                let mut texts: Vec<&str> = way
                    .iter()
                    .zip(nexts)
                    .flat_map(|(by, from)| &edges[by][from])
                    .copied()
                    .collect();
                // The same circle, wherever it begins.
                texts.sort_unstable();
                return Some(texts.join("\n"));
            }
            if reached.insert(next) {
                ways.push_back(way.iter().chain([next]).copied().collect());
            }
        }
    }
    None
}

fn is_name(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Returns the leaves of a `use`, each with its path and the name that it has in the module.
fn leaves(tree: &[&str]) -> Vec<(Names, String)> {
    let names = |tokens: &[&str]| -> Names {
        let names = tokens.iter().filter(|token| **token != "::");
        names.map(|name| (*name).to_owned()).collect()
    };
    let Some(brace) = tree.iter().position(|token| *token == "{") else {
        let mut path = names(tree);
        let alias = path.iter().position(|name| name == "as");
        let alias = alias.and_then(|at| path.drain(at..).next_back());
        let last = path.last().cloned().unwrap_or_default();
        path.pop_if(|last| matches!(last.as_str(), "self" | "*"));
        return vec![(path, alias.unwrap_or(last))];
    };
    let before = names(&tree[..brace]);
    let mut all = Vec::new();
    let mut depth = 0;
    let mut start = brace + 1;
    for (at, token) in tree.iter().enumerate().skip(brace) {
        match *token {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        let ends = (*token == "," && depth == 1) || (*token == "}" && depth == 0);
        if ends && start < at {
            for (path, name) in leaves(&tree[start..at]) {
                let name =
                    if name == "self" { before.last().cloned().unwrap_or(name) } else { name };
                all.push((before.iter().cloned().chain(path).collect(), name));
            }
        }
        if ends {
            start = at + 1;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(files: &[(&str, &str)]) -> Package {
        let mut package = Package::default();
        files.iter().for_each(|(file, text)| package.add(file, text));
        package
    }

    fn circles(files: &[(&str, &str)]) -> Vec<String> {
        package(files).circles().into_iter().collect()
    }

    /// Code of `a` that imports from `b`, where the root passes on `B`.
    const FORMS: [&str; 11] = [
        "use super::b::B;",
        "use crate::{a::f as own, b::{B as Other}};",
        "use crate::B;",
        "use super::b; fn f() { b::g() }",
        "use super::b::{self as other}; fn f() { other::g() }",
        "fn f() -> Option<crate::b::B> { None }",
        "fn f() { super::b::g::<u8>(1) }",
        "use super::*; fn f(_: B) {}",
        "#[serde(try_from = \"super::b::B\")] struct A;",
        "mod inner { use super::super::b::B; }",
        "macro_rules! call { () => { $crate::b::g() } }",
    ];

    #[test]
    fn finds_a_circle_in_any_form() {
        for form in FORMS {
            let a = format!("pub fn f() {{}}\n{form}");
            let b = "use super::a::f; pub struct B; pub fn g() {}";
            let root = "pub mod a; mod b; pub use b::B;";
            let found = circles(&[("lib.rs", root), ("a.rs", &a), ("b.rs", b)]);
            let [circle] = &found[..] else { panic!("{form}: {found:?}") };
            assert!(circle.contains("a.rs imports ") && circle.contains(" of b.rs"), "{circle}");
            assert!(circle.contains("b.rs imports f of a.rs"), "{circle}");
        }
    }

    #[test]
    fn follows_names_through_globs_and_folders() {
        let files = [
            ("lib.rs", "mod shapes; mod user; pub use shapes::*;"),
            ("shapes/mod.rs", "mod line; pub use self::line::{Line, LONGEST};"),
            ("shapes/line.rs", "use crate::user::User; pub struct Line;"),
            ("user.rs", "use crate::Line as Way; pub struct User;"),
        ];
        let expected = "shapes/line.rs imports User of user.rs\n\
                        user.rs imports Line of shapes/line.rs";
        assert_eq!(circles(&files), [expected]);
    }

    #[test]
    fn finds_circles_with_a_parent_of_three_and_of_folders() {
        let parent = [
            ("main.rs", "mod line; pub struct Side; fn main() { line::draw() }"),
            ("line.rs", "use super::Side; pub fn draw() {}"),
        ];
        assert_eq!(circles(&parent).len(), 1, "{:?}", circles(&parent));
        let three = [
            ("lib.rs", "mod a; mod b; mod c;"),
            ("a.rs", "use crate::b::B; pub struct A;"),
            ("b.rs", "use crate::c::C; pub struct B;"),
            ("c.rs", "use crate::a::A; pub struct C;"),
        ];
        assert_eq!(circles(&three).len(), 1, "{:?}", circles(&three));
        let folders = [
            ("lib.rs", "mod a; mod b;"),
            ("a/mod.rs", "pub mod x; pub mod y;"),
            ("a/x.rs", "use crate::b::x::B;"),
            ("a/y.rs", "pub struct A;"),
            ("b/mod.rs", "pub mod x; pub mod y;"),
            ("b/x.rs", "pub struct B;"),
            ("b/y.rs", "use crate::a::y::A;"),
        ];
        let expected = "a/x.rs imports B of b/x.rs\nb/y.rs imports A of a/y.rs";
        assert_eq!(circles(&folders), [expected]);
    }

    #[test]
    fn takes_no_other_mention_for_an_import() {
        let b = "use super::a::f; pub struct B;";
        for a in [
            "// use super::b::B;\n/* super::b::B /* */ */ /// [`crate::b::B`]\npub fn f() {}",
            "const TEXT: &str = \"see super::b::B\"; const RAW: &str = r#\"\" super::b::B\"#;",
            "#[cfg(test)]\nmod tests { use super::super::b::B; }\npub fn f() {}",
            "#[cfg(all(test, feature = \"x\"))]\nuse super::b::B;\npub fn f() {}",
            "pub(in crate::b) fn f<'b>(b: &'b str) -> char { b.b; '\"' }",
            "use other::b::B; use std::b; pub fn f() -> impl Sized + use<> {}",
        ] {
            let files = [("lib.rs", "mod a; mod b; pub use b::B;"), ("a.rs", a), ("b.rs", b)];
            assert_eq!(circles(&files), [""; 0], "{a}");
        }
        let passes_on = [
            ("lib.rs", "mod a; #[cfg(test)] mod tests; pub use a::{A, g}; pub struct Own;"),
            ("a.rs", "use crate::Own; pub struct A; pub fn g() {}"),
            ("tests.rs", "use super::Own; use crate::a::A;"),
        ];
        assert_eq!(circles(&passes_on), [""; 0]);
        assert_eq!(package(&passes_on).imports().len(), 1);
    }
}
