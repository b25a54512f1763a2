//! Runs both filters over the vectors: on the board the results go to the debugger by semihosting,
//! and stack and instructions are reported; on the host they go to standard output.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;

#[cfg(not(target_os = "none"))]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut results = String::new();
    foxhunt_embedded::run_ekf(&mut results, || 0).map_err(|failure| failure.to_string())?;
    foxhunt_embedded::run_ukf(&mut results, || 0).map_err(|failure| failure.to_string())?;
    print!("{results}");
    Ok(())
}
