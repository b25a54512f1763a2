//! `hunt --live` over its socket.

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    process::{Child, Command, Stdio},
};

use serde_json::Value;

use crate::support::{folder, foxhunt};

/// A hunt with a live view; ended with the test.
struct Hunt {
    child: Child,
    port: u16,
}

impl Hunt {
    fn start(args: &[&str], token: Option<&str>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_foxhunt"));
        command.arg("hunt").args(args).stdout(Stdio::null()).stderr(Stdio::piped());
        command.envs(token.map(|token| ("FOXHUNT_LIVE_TOKEN", token)));
        let mut child = command.spawn().expect("the program was built for this test");
        let mut notes = BufReader::new(child.stderr.take().expect("it is a pipe"));
        let mut line = String::new();
        while !line.contains("live view: http://") {
            line.clear();
            assert!(notes.read_line(&mut line).expect("UTF-8") > 0, "no address");
        }
        // Whoever does not read lets the program wait.
        std::thread::spawn(move || notes.read_to_string(&mut String::new()));
        let (_, port) = line.split('/').nth(2).and_then(|it| it.split_once(':')).expect("a port");
        Self { child, port: port.trim().parse().expect("a number") }
    }

    /// Sends a request, and returns the connection.
    fn request(&self, line: &str, headers: &str) -> BufReader<TcpStream> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it is served");
        let request = format!("{line} HTTP/1.0\r\nHost: 127.0.0.1\r\n{headers}\r\n");
        stream.write_all(request.as_bytes()).expect("it listens");
        BufReader::new(stream)
    }

    fn status(&self, line: &str, headers: &str) -> u16 {
        let mut first = String::new();
        let _ = self.request(line, headers).read_line(&mut first).expect("an answer");
        first.split(' ').nth(1).expect("a status").parse().expect("a number")
    }
}

impl Drop for Hunt {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The next server-sent event: its number, its name and its data.
fn next(stream: &mut BufReader<TcpStream>) -> Option<[String; 3]> {
    let mut event = [const { String::new() }; 3];
    for line in stream.lines() {
        let line = line.expect("UTF-8");
        for (field, value) in ["id: ", "event: ", "data: "].iter().zip(&mut event) {
            if let Some(text) = line.strip_prefix(field) {
                text.clone_into(value);
            }
        }
        if line.is_empty() && event.iter().any(|value| !value.is_empty()) {
            return Some(event);
        }
    }
    None
}

/// Number of receptions in the rest of the news, up to the end of the hunt.
fn receptions(stream: &mut BufReader<TcpStream>) -> usize {
    let mut count = 0;
    loop {
        let [_, name, data] = next(stream).expect("the hunt ends before the connection");
        if name == "over" {
            return count;
        }
        count += in_news(&data);
    }
}

fn in_news(data: &str) -> usize {
    let news: Value = serde_json::from_str(data).expect("JSON");
    news["news"]["received"].as_array().expect("a list").len()
}

#[test]
fn all_get_the_whole_hunt_whenever_they_come() {
    let out = folder("live");
    let out = out.to_str().expect("the target folder is UTF-8");
    let hunt = Hunt::start(&["--live=127.0.0.1:0", "--pace", "100", "--out", out], None);
    let mut early = hunt.request("GET /events", "");
    let mut last = String::new();
    let mut had = 0;
    while had < 5 {
        let [id, _, data] = next(&mut early).expect("the hunt goes on");
        had += in_news(&data);
        last = id;
    }
    // One that was cut off has the number of what came last.
    let mut back = hunt.request("GET /events", &format!("Last-Event-ID: {last}\r\n"));
    let mut late = hunt.request("GET /events", "");
    let early = had + receptions(&mut early);
    let back = had + receptions(&mut back);
    let late = receptions(&mut late);
    // When all is over the page still stands.
    let after = receptions(&mut hunt.request("GET /events", ""));
    let log = fs::read_to_string(format!("{out}/hunt.jsonl")).expect("it was written");
    let logged = log.lines().filter(|line| line.contains("\"event\":\"received\"")).count();
    assert_eq!([early, back, late, after], [logged; 4]);

    let other = next(&mut hunt.request("GET /events", "Last-Event-ID: 12ab-7\r\n"));
    assert_eq!(other.map(|[_, name, _]| name).as_deref(), Some("other"), "another hunt's number");
    let mut page = String::new();
    hunt.request("GET /", "").read_to_string(&mut page).expect("UTF-8");
    assert!(page.contains("EventSource") && page.contains("\"live\":{\"orders\":false}"));
    assert_eq!(hunt.status("POST /break-off", ""), 403, "nobody gives orders");
    assert_eq!(hunt.status("GET /hunt.jsonl", ""), 404);
}

#[test]
fn a_token_is_needed_where_there_is_one() {
    let out = folder("live_token");
    let out = out.to_str().expect("the target folder is UTF-8");
    let token = "correct-horse";
    let hunt = Hunt::start(&["--live=127.0.0.1:0", "--pace", "1000", "--out", out], Some(token));
    for path in ["GET /", "GET /events", "GET /?token=correct-hors", "POST /break-off"] {
        assert_eq!(hunt.status(path, ""), 401, "{path}");
    }
    assert_eq!(hunt.status("GET /", "Authorization: Bearer correct-horse\r\n"), 200);
    assert_eq!(hunt.status("GET /", "Cookie: foxhunt_live_token=correct-horse\r\n"), 200);
    assert_eq!(hunt.status("GET /?token=correct-horse", ""), 303);
    // A simulated hunt takes no orders from anybody.
    let order = hunt.status("POST /break-off", "Authorization: Bearer correct-horse\r\n");
    assert_eq!(order, 403);
}

#[test]
fn a_map_is_for_who_may_look() {
    let out = folder("live_tiles");
    let map = out.join("map");
    fs::create_dir_all(map.join("3/4")).expect("a folder");
    fs::write(map.join("3/4/2.png"), b"\x89PNG\r\n\x1a\nrest").expect("a tile");
    fs::write(map.join("3/4/3.png"), b"no image").expect("a file");
    let [out, map] = [&out, &map].map(|path| path.to_str().expect("the target folder is UTF-8"));
    let args = ["--live=127.0.0.1:0", "--pace", "1000", "--out", out, "--tiles", map];
    let args = [&args[..], &["--origin", "50.08,14.44"]].concat();
    let hunt = Hunt::start(&args, Some("correct-horse"));
    assert_eq!(hunt.status("GET /tiles/3/4/2", ""), 401);
    let token = "Authorization: Bearer correct-horse\r\n";
    let mut tile = String::new();
    let mut answer = hunt.request("GET /tiles/3/4/2", token);
    while !tile.ends_with("\r\n\r\n") {
        assert!(answer.read_line(&mut tile).expect("headers are text") > 0, "{tile}");
    }
    assert!(tile.contains(" 200 ") && tile.contains("content-type: image/png"), "{tile}");
    // Not there, no image, and no place on Earth.
    for path in ["3/4/4", "3/4/3", "3/8/0", "99/0/0"] {
        assert_eq!(hunt.status(&format!("GET /tiles/{path}"), token), 204, "{path}");
    }
    assert_eq!(hunt.status("GET /tiles/3/4/..%2F2", token), 400);
    foxhunt(["hunt", "--live=127.0.0.1:0", "--tiles", map]).failed(2, &["--tiles", "--origin"]);
    foxhunt(["hunt", "--origin", "50,14"]).failed(2, &["--origin"]);
}

#[test]
fn it_ends_with_the_hunt_where_that_is_wanted() {
    let out = folder("live_done");
    let out = out.to_str().expect("the target folder is UTF-8");
    let ran =
        foxhunt(["hunt", "--live=127.0.0.1:0", "--live-until-done", "--pace", "1e6", "--out", out]);
    assert_eq!(ran.code, 0, "{ran:?}");
}

#[test]
fn what_cannot_be_served_is_refused_before_the_hunt() {
    let out = folder("live_refused");
    let log = out.join("hunt.jsonl");
    let out = out.to_str().expect("the target folder is UTF-8");
    let refused = |args: &[&str], texts: &[&str]| {
        foxhunt([&["hunt", "--out", out], args].concat()).failed(2, texts);
    };
    refused(&["--live=0.0.0.0:0"], &["0.0.0.0:0", "needs a token", "FOXHUNT_LIVE_TOKEN"]);
    refused(&["--live=127.0.0.1:0", "--live-token", "short"], &["at least 8"]);
    refused(&["--live=somewhere"], &["somewhere"]);
    refused(&["--pace", "5"], &["--live"]);
    refused(&["--live", "--pace", "0"], &["--pace"]);
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("it is bound").to_string();
    refused(&[&format!("--live={address}")], &[&address, "cannot be served"]);
    assert!(!log.exists(), "nothing was flown");
}
