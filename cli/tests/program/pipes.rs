use std::process::{Command, Stdio};

#[test]
fn a_reader_that_leaves_is_no_failure() {
    for args in [&["list", "scenarios"][..], &["campaign", "--runs", "2"]] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_foxhunt"))
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program was built for this test");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("it ends");
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        assert!(!stderr.contains("panicked") && !stderr.contains("error"), "{stderr}");
    }
}
