//! Writes the sequences of `vectors/filter_runs.json` as tables, and gives the linker the board's
//! memory.

use std::{env, error::Error, fmt::Write, fs, path::Path};

use serde_json::Value;

const VECTORS: &str = "../../vectors/filter_runs.json";

const BEGIN: &str = "
#[expect(clippy::approx_constant, reason = \"what was measured is near some\")]
static SEQUENCES: &[Sequence] = &[
";

fn main() -> Result<(), Box<dyn Error>> {
    let out = env::var("OUT_DIR")?;
    let vectors: Value = serde_json::from_str(&fs::read_to_string(VECTORS)?)?;
    let sequences = vectors["sequences"].as_array().ok_or("the sequences are a list")?;
    let mut tables = String::from(BEGIN);
    for sequence in sequences {
        write_sequence(&mut tables, sequence)?;
    }
    tables.push_str("];\n");
    fs::write(Path::new(&out).join("sequences.rs"), tables)?;
    println!("cargo::rerun-if-changed={VECTORS}");

    if env::var("CARGO_CFG_TARGET_OS")? == "none" {
        fs::copy("memory.x", Path::new(&out).join("memory.x"))?;
        println!("cargo::rustc-link-search={out}");
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
        println!("cargo::rerun-if-changed=memory.x");
    }
    Ok(())
}

fn write_sequence(tables: &mut String, sequence: &Value) -> Result<(), Box<dyn Error>> {
    let float = |key: &str| sequence[key].as_f64().ok_or(format!("{key} is a number"));
    writeln!(tables, "Sequence {{ name: {},", sequence["name"])?;
    writeln!(tables, "prior_mean: {:?},", numbers(&sequence["x0"])?)?;
    writeln!(tables, "prior_variance: {:?},", numbers(&sequence["P0"][0])?[0])?;
    writeln!(tables, "drift: {:?},", float("Q_diag")?.sqrt())?;
    writeln!(tables, "reference_dbm: {:?}, exponent: {:?},", float("p0")?, float("gamma")?)?;
    writeln!(tables, "steps: &[")?;
    for (i, z) in sequence["z"].as_array().ok_or("z is a list")?.iter().enumerate() {
        let sigmas = [&sequence["sigma_rss"][i], &sequence["sigma_theta"][i]];
        writeln!(
            tables,
            "Step {{ receiver: {:?}, value: {:?}, sigmas: [{}, {}], ekf: {:?}, ukf: {:?} }},",
            numbers(&sequence["mav"][i])?,
            numbers(z)?,
            decimal(sigmas[0])?,
            decimal(sigmas[1])?,
            numbers(&sequence["runs"]["ekf"]["steps"][i]["x"])?,
            numbers(&sequence["runs"]["ukf_redraw"]["steps"][i]["x"])?,
        )?;
    }
    writeln!(tables, "] }},")?;
    Ok(())
}

fn numbers(list: &Value) -> Result<Vec<f64>, Box<dyn Error>> {
    let list = list.as_array().ok_or(format!("{list} is a list"))?;
    list.iter().map(|each| Ok(each.as_f64().ok_or(format!("{each} is a number"))?)).collect()
}

/// A number as a literal.
fn decimal(number: &Value) -> Result<String, Box<dyn Error>> {
    Ok(format!("{:?}", number.as_f64().ok_or(format!("{number} is a number"))?))
}
