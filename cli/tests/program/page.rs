//! The page that works without an installation.

use std::fs;

use crate::support::{folder, foxhunt};

#[test]
fn a_page_is_written_and_named() {
    let path = folder("page").join("foxhunt.html");
    let name = path.to_str().expect("UTF-8");
    let json = foxhunt(["--json", "page", "--out", name]).json();
    let page = fs::read_to_string(&path).expect("the page");
    assert_eq!(json["page"], name);
    assert_eq!(json["bytes"], page.len());
    assert!(page.starts_with("<!doctype html>") && page.ends_with("</html>\n"));
    let ran = foxhunt(["page", "--out", name]);
    assert_eq!((ran.code, ran.stdout.trim_end()), (0, &*format!("page: {name}")));
}

#[test]
fn a_service_worker_is_written_beside_an_installable_page() {
    let path = folder("page-installable").join("index.html");
    let name = path.to_str().expect("UTF-8");
    let json = foxhunt(["--json", "page", "--out", name, "--installable"]).json();
    let worker = path.with_extension("js");
    assert_eq!(json["service_worker"], worker.to_str().expect("UTF-8"));
    let page = fs::read_to_string(&path).expect("the page");
    assert!(page.contains(" data-offline=\"index.js\""));
    assert!(fs::read_to_string(worker).expect("the worker").contains("\"index.html\""));
}

#[test]
fn a_page_that_cannot_be_written_is_named() {
    let path = folder("page-nowhere").join("missing").join("foxhunt.html");
    let name = path.to_str().expect("UTF-8");
    foxhunt(["page", "--out", name]).failed(1, &["missing", "foxhunt.html"]);
}
