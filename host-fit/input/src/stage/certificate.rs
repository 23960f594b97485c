//! Reads the optional table `[certificate]`: what ISO/IEC 17025, 7.8 asks for beside the results, and the decision rule.

use super::document::{Document, Value};
use super::error::StageError;

const TABLE: &str = "certificate";
/// The texts of a certificate by their keys, in its order.
pub const TEXTS: [&str; 7] = [
    "number",
    "laboratory",
    "customer",
    "method",
    "conditions",
    "instruments",
    "authorised_by",
];
/// Limits that make sense, m or rad.
const LIMITS: (f64, f64) = (1e-12, 1.0);

/// What the table says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CertificateTable {
    /// [`TEXTS`]; empty where they are not given.
    pub texts: [String; TEXTS.len()],
    /// Largest rms errors of X, Y, Rz in service: m, m, rad.
    pub limits: [Option<f64>; 3],
    /// Whether the limits are less a guard band: the uncertainty of the rms errors (JCGM 106).
    pub is_guarded: bool,
}

pub(super) fn certificate(document: &Document<'_>) -> Result<CertificateTable, StageError> {
    let text = |key: &str| {
        let value = document.get(TABLE, key)?;
        let lines = value.items();
        let lines: Vec<&str> = lines.iter().filter_map(Value::as_text).collect();
        Some(value.as_text().map_or(lines.join("; "), str::to_owned))
    };
    let mut limits = [None; 3];
    for (limit, key) in limits.iter_mut().zip(["x_m", "y_m", "rz_rad"]) {
        let unit = key.rsplit('_').next().unwrap_or_default();
        *limit = document.number("certificate.limit", key, LIMITS, unit)?;
    }
    let guarded = document.get(TABLE, "guarded");
    Ok(CertificateTable {
        texts: TEXTS.map(|key| text(key).unwrap_or_default()),
        limits,
        is_guarded: guarded.map_or(Ok(false), |value| document.read(&value))?,
    })
}

#[cfg(test)]
mod tests {
    use crate::shipped::STAGE_TOML;
    use crate::stage::Stage;

    #[test]
    fn the_texts_stand_in_the_order_of_a_certificate_and_lists_are_joined() {
        let table = "\n[certificate]\ninstruments = [\"a\", \"b\"]\nnumber = \"7\"\nlimit = { y_m = 1e-6 }\nguarded = true\n";
        let read = |more: &str| {
            Stage::from_toml(&format!("{STAGE_TOML}{table}{more}"), "stage.toml".as_ref())
        };
        let found = read("").expect("sound").certificate;
        assert_eq!(found.texts, ["7", "", "", "", "", "a; b", ""]);
        assert_eq!(
            (found.limits, found.is_guarded),
            ([None, Some(1e-6), None], true)
        );
        let error = read("customers = 1\n").expect_err("unknown").to_string();
        assert!(error.contains("did you mean `customer`"), "{error}");
    }
}
