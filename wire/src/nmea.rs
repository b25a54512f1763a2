//! Sentences of NMEA 0183 as fields.

use crate::geodesy::Geodetic;

/// Reason for refusing a sentence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// It has no checksum.
    Unchecked,
    /// It has another checksum, or is no sentence.
    Damaged,
    /// A field is not what stands there in its kind of sentence.
    Field,
}

/// A sentence whose checksum is right. An empty field is a missing value.
#[derive(Clone, Debug)]
pub struct Sentence<'a> {
    kind: &'a str,
    fields: Vec<&'a str>,
}

impl<'a> Sentence<'a> {
    /// Reads a sentence from its `$` to its checksum.
    ///
    /// # Errors
    ///
    /// [`Malformed::Unchecked`] without a checksum, [`Malformed::Damaged`] with another one.
    pub fn parse(text: &'a str) -> Result<Self, Malformed> {
        let rest = text.strip_prefix('$').filter(|_| text.is_ascii()).ok_or(Malformed::Damaged)?;
        let (body, digits) = rest.split_once('*').ok_or(Malformed::Unchecked)?;
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        let is_hexadecimal = |digits: &&str| digits.bytes().all(|byte| byte.is_ascii_hexdigit());
        // A number with a sign would be read, too.
        let digits = digits.get(..2).filter(is_hexadecimal).ok_or(Malformed::Damaged)?;
        if u8::from_str_radix(digits, 16) != Ok(sum) {
            return Err(Malformed::Damaged);
        }
        let mut fields = body.split(',');
        let address = fields.next().unwrap_or_default();
        // Two letters of the talker and three of the kind; P begins those of a maker's own.
        let kind = match address.len() {
            5 if !address.starts_with('P') => address.get(2..).unwrap_or_default(),
            _ => "",
        };
        Ok(Self { kind, fields: fields.map(str::trim).collect() })
    }

    /// Returns the three letters of the sentence's kind; empty for a maker's own sentence.
    #[must_use]
    pub fn kind(&self) -> &'a str {
        self.kind
    }

    /// The text of a field, unless it is empty.
    #[must_use]
    pub fn text(&self, at: usize) -> Option<&'a str> {
        self.fields.get(at).copied().filter(|text| !text.is_empty())
    }

    /// Returns the finite number of a field; `None` if the field is empty.
    ///
    /// # Errors
    ///
    /// [`Malformed::Field`] for any other text.
    pub fn number(&self, at: usize) -> Result<Option<f64>, Malformed> {
        let Some(text) = self.text(at) else { return Ok(None) };
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        number.map(Some).ok_or(Malformed::Field)
    }

    /// Returns the whole number of a field; `None` if the field is empty.
    ///
    /// # Errors
    ///
    /// [`Malformed::Field`] for any other text.
    pub fn count(&self, at: usize) -> Result<Option<u32>, Malformed> {
        self.text(at).map(|text| text.parse().map_err(|_| Malformed::Field)).transpose()
    }

    /// A number and the letter of its sign in the field after it; `None` without either.
    ///
    /// # Errors
    ///
    /// [`Malformed::Field`] for another letter, or no number.
    pub fn signed(
        &self,
        at: usize,
        positive: &str,
        negative: &str,
    ) -> Result<Option<f64>, Malformed> {
        let Some((number, letter)) = self.number(at)?.zip(self.text(at + 1)) else {
            return Ok(None);
        };
        match letter {
            letter if letter == positive => Ok(Some(number)),
            letter if letter == negative => Ok(Some(-number)),
            _ => Err(Malformed::Field),
        }
    }

    /// Seconds since midnight of a field `hhmmss.s`.
    ///
    /// # Errors
    ///
    /// [`Malformed::Field`] for a time that is out of range.
    pub fn time(&self, at: usize) -> Result<Option<f64>, Malformed> {
        let Some(number) = self.number(at)? else { return Ok(None) };
        let hours = (number / 1e4).trunc();
        let minutes = (number / 1e2).trunc() - hours * 1e2;
        let seconds = number - hours * 1e4 - minutes * 1e2;
        // A leap second is the 61st.
        let proper = (0.0..24.0).contains(&hours) && minutes < 60.0 && seconds < 61.0;
        if number < 0.0 || !proper {
            return Err(Malformed::Field);
        }
        Ok(Some(hours * 3600.0 + minutes * 60.0 + seconds))
    }

    /// Latitude and longitude in degrees of the four fields from `at` on; `None` where one of them
    /// is empty.
    ///
    /// # Errors
    ///
    /// [`Malformed::Field`] for a place that is out of range.
    pub fn spot(&self, at: usize) -> Result<Option<(f64, f64)>, Malformed> {
        let lat = self.angle(at, "N", "S")?;
        let lon = self.angle(at + 2, "E", "W")?;
        let (Some(lat_deg), Some(lon_deg)) = (lat, lon) else { return Ok(None) };
        let spot = Geodetic::new(lat_deg, lon_deg, 0.0).map_err(|_| Malformed::Field)?;
        Ok(Some((spot.lat_deg, spot.lon_deg)))
    }

    /// Degrees of a field `ddmm.mm` and the letter of its sign; the number itself has no sign.
    fn angle(&self, at: usize, positive: &str, negative: &str) -> Result<Option<f64>, Malformed> {
        if self.number(at)?.is_some_and(f64::is_sign_negative) {
            return Err(Malformed::Field);
        }
        self.signed(at, positive, negative)?.map(degrees).transpose()
    }
}

/// Degrees of `ddmm.mm`.
fn degrees(value: f64) -> Result<f64, Malformed> {
    let whole = (value / 100.0).trunc();
    let minutes = value - whole * 100.0;
    if minutes.abs() >= 60.0 {
        return Err(Malformed::Field);
    }
    Ok(whole + minutes / 60.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn sentence(body: &str) -> String {
        format!("${body}*{:02X}", body.bytes().fold(0, |sum, byte| sum ^ byte))
    }

    #[test]
    fn fields_are_values_missing_or_refused() {
        let text = sentence("GPXYZ,123456.50,5006.0,N,01430.0,W,, 7,-1.5,0560.0,E,240000,S");
        let read = Sentence::parse(&text).expect("proper");
        assert_eq!(read.kind(), "XYZ");
        let time = read.time(0).expect("a time").expect("given");
        assert_abs_diff_eq!(time, 45_296.5, epsilon = 1e-6);
        let (lat, lon) = read.spot(1).expect("a place").expect("given");
        assert_abs_diff_eq!(lat, 50.1, epsilon = 1e-12);
        assert_abs_diff_eq!(lon, -14.5, epsilon = 1e-12);
        assert_eq!((read.number(5), read.count(6)), (Ok(None), Ok(Some(7))));
        assert_eq!((read.number(7), read.number(99)), (Ok(Some(-1.5)), Ok(None)));
        assert_eq!(read.number(2), Err(Malformed::Field));
        assert_eq!(read.time(10), Err(Malformed::Field), "there is no hour 24");
        assert_eq!(read.signed(8, "N", "S"), Err(Malformed::Field), "East is no latitude");
        // 60 minutes are no minutes, 91° is no latitude, and the letter alone has the sign.
        for body in [
            "GPGLL,5060.0,N,01430.0,E",
            "GPGLL,9106.0,N,01430.0,E",
            "GPGLL,-5006.0,N,01430.0,E",
            "GPGLL,5006.0,S,-01430.0,W",
        ] {
            let text = sentence(body);
            let read = Sentence::parse(&text).expect("proper");
            assert_eq!(read.spot(0), Err(Malformed::Field), "{body}");
        }
        assert_eq!(Sentence::parse(&sentence("PUBX,00,1")).expect("proper").kind(), "");
        assert_eq!(Sentence::parse("$GPGLL,5006.0,N").err(), Some(Malformed::Unchecked));
        assert_eq!(Sentence::parse("$GPGLL,5006.0,N*00").err(), Some(Malformed::Damaged));
        assert_eq!(Sentence::parse("$GPGLL,5006.0,N*5").err(), Some(Malformed::Damaged));
        assert_eq!(Sentence::parse("GPGLL*00").err(), Some(Malformed::Damaged));
        // The sum of this sentence is 5: a sign is no digit.
        assert!(Sentence::parse("$GPXYZ,e*05").is_ok());
        assert_eq!(Sentence::parse("$GPXYZ,e*+5").err(), Some(Malformed::Damaged));
    }
}
