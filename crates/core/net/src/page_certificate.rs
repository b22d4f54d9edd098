//! The certificate of a page for other machines. Browsers want more of it than workers do, who know
//! its fingerprint: the names by which the page is reached, a stated use, and a short life. It is
//! therefore another one than the server's, which must stay.

use std::{
    fs, io,
    net::IpAddr,
    path::Path,
    time::{SystemTime, UNIX_EPOCH},
};

use rcgen::{
    CertificateParams, DnType, ExtendedKeyUsagePurpose, KeyPair, KeyUsagePurpose, date_time_ymd,
};

/// Life of a certificate, days. Browsers refuse more than 825.
const LIFE: i64 = 397;

/// A certificate with fewer days left is replaced.
const LEAST_LEFT: i64 = 30;

const DAY: u64 = 86_400;

/// Files of the certificate, of its key, and of what it was made for.
pub(crate) const CERTIFICATE: &str = "page.der";
pub(crate) const KEY: &str = "page-key.der";
const MADE_FOR: &str = "page.txt";

/// Returns the names and addresses by which other machines may reach a page at an address.
pub(crate) fn names(address: IpAddr) -> Vec<String> {
    let mut names = vec!["localhost".to_owned(), "127.0.0.1".to_owned(), "::1".to_owned()];
    if !address.is_unspecified() {
        names.push(address.to_string());
    }
    let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
    names.extend(interfaces.iter().map(|interface| interface.ip().to_string()));
    let host = fs::read_to_string("/proc/sys/kernel/hostname");
    let host = host.or_else(|_| fs::read_to_string("/etc/hostname")).unwrap_or_default();
    let host = host.trim().to_ascii_lowercase();
    let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '.';
    if !host.is_empty() && host.chars().all(is_name) {
        // Many networks announce machines under this name.
        names.push(format!("{}.local", host.split('.').next().unwrap_or_default()));
        names.push(host);
    }
    names.sort_unstable();
    names.dedup();
    names
}

/// Returns the number of days since 1970.
pub(crate) fn today() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    (since.as_secs() / DAY) as i64
}

/// Makes a certificate for these names in a folder, unless it has one that is still good on this
/// day. `write` writes a file that only its owner can read.
pub(crate) fn renew(
    folder: &Path,
    names: &[String],
    today: i64,
    write: impl Fn(&Path, &[u8]) -> io::Result<()>,
) -> io::Result<()> {
    let known = fs::read_to_string(folder.join(MADE_FOR)).unwrap_or_default();
    let mut lines = known.lines();
    let last = lines.next().and_then(|line| line.parse::<i64>().ok());
    let is_long = last.is_some_and(|last| (LEAST_LEFT..=LIFE).contains(&(last - today)));
    if is_long && lines.eq(names.iter()) && folder.join(CERTIFICATE).exists() {
        return Ok(());
    }
    let mut params = CertificateParams::new(names.to_vec()).map_err(io::Error::other)?;
    params.distinguished_name.push(DnType::CommonName, "Holodeck");
    params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
    let date = |day| {
        let (year, month, day) = date_of(day);
        date_time_ymd(year, month, day)
    };
    // Clocks of other machines may be late.
    (params.not_before, params.not_after) = (date(today - 1), date(today + LIFE));
    let key = KeyPair::generate().map_err(io::Error::other)?;
    let made = params.self_signed(&key).map_err(io::Error::other)?;
    // While the certificate is replaced, nothing says what it was made for.
    let _ = fs::remove_file(folder.join(MADE_FOR));
    write(&folder.join(KEY), key.serialized_der())?;
    write(&folder.join(CERTIFICATE), made.der())?;
    let made_for = format!("{}\n{}\n", today + LIFE, names.join("\n"));
    write(&folder.join(MADE_FOR), made_for.as_bytes())
}

/// Returns year, month and day of a day since 1970 (Hinnant, "chrono-compatible low-level date
/// algorithms", `civil_from_days`).
fn date_of(day: i64) -> (i32, u8, u8) {
    let day = day + 719_468;
    let (era, of_era) = (day.div_euclid(146_097), day.rem_euclid(146_097));
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let date = of_year - (153 * month + 2) / 5 + 1;
    let (month, next) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    ((year + era * 400 + next) as i32, month as u8, date as u8)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio_rustls::rustls::{
        RootCertStore,
        client::{verify_server_cert_signed_by_trust_anchor, verify_server_name},
        crypto::ring::default_provider,
        pki_types::{CertificateDer, ServerName, UnixTime},
        server::ParsedCertificate,
    };

    use super::*;

    fn made(folder: &Path, names: &[&str], today: i64) -> CertificateDer<'static> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        renew(folder, &names, today, |path, bytes| fs::write(path, bytes)).unwrap();
        CertificateDer::from(fs::read(folder.join(CERTIFICATE)).unwrap())
    }

    fn is_good(certificate: &CertificateDer<'static>, day: i64) -> bool {
        let mut roots = RootCertStore::empty();
        roots.add(certificate.clone()).unwrap();
        let parsed = ParsedCertificate::try_from(certificate).unwrap();
        let now = UnixTime::since_unix_epoch(Duration::from_secs(day as u64 * DAY + 1));
        let provider = default_provider();
        let all = provider.signature_verification_algorithms.all;
        verify_server_cert_signed_by_trust_anchor(&parsed, &roots, &[], now, all).is_ok()
    }

    #[test]
    fn a_certificate_names_what_it_is_reached_by_and_lives_for_397_days() {
        let folder = tempfile::tempdir().unwrap();
        let today = today();
        let names = ["192.0.2.7", "house.example", "localhost"];
        let certificate = made(folder.path(), &names, today);
        let parsed = ParsedCertificate::try_from(&certificate).unwrap();
        let is_for = |name: &str| {
            verify_server_name(&parsed, &ServerName::try_from(name.to_owned()).unwrap()).is_ok()
        };
        assert!(names.iter().all(|name| is_for(name)));
        assert!(!is_for("other.example") && !is_for("192.0.2.8"));
        for (day, good) in [(-2, false), (0, true), (396, true), (398, false)] {
            assert_eq!(is_good(&certificate, today + day), good, "{day}");
        }
    }

    #[test]
    fn a_certificate_stays_until_it_ends_soon_or_the_names_change() {
        let folder = tempfile::tempdir().unwrap();
        let first = made(folder.path(), &["a.example"], 20_000);
        assert_eq!(made(folder.path(), &["a.example"], 20_300), first);
        let second = made(folder.path(), &["a.example"], 20_380);
        assert_ne!(second, first);
        let third = made(folder.path(), &["a.example", "b.example"], 20_380);
        assert_ne!(third, second);
        // A clock that was far ahead does not keep a certificate that is not valid yet.
        assert_ne!(made(folder.path(), &["a.example", "b.example"], 20_000), third);
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (day, date) in [
            (0, (1970, 1, 1)),
            (11_016, (2000, 2, 29)),
            (11_017, (2000, 3, 1)),
            (20_785, (2026, 11, 28)),
            (47_540, (2100, 2, 28)),
            (47_541, (2100, 3, 1)),
        ] {
            assert_eq!(date_of(day), date, "{day}");
        }
    }

    #[test]
    fn this_machine_is_reached_by_its_names_and_addresses() {
        let names = names("192.0.2.9".parse().unwrap());
        for name in ["localhost", "127.0.0.1", "192.0.2.9"] {
            assert!(names.iter().any(|known| known == name), "{names:?}");
        }
        assert!(CertificateParams::new(names).is_ok());
    }
}
