//! The library's functions, and its objects that are released when they are dropped.

use std::{
    ffi::{CStr, c_char, c_int, c_void},
    path::Path,
    sync::Arc,
};

use libloading::Library;

use crate::{error::DenoiseError, quality::Quality};

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;

/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// `OIDN_ERROR_CANCELLED`.
const CANCELLED: c_int = 6;

/// `OIDN_QUALITY_BALANCED` and `OIDN_QUALITY_HIGH`.
const BALANCED: c_int = 5;
const HIGH: c_int = 6;

type Object = *mut c_void;
type Name = *const c_char;

/// `OIDNProgressMonitorFunction`: the progress so far, to whether the filter goes on.
type Monitor = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// Returns whether a filter goes on.
pub type GoesOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// The library's functions that are used, as declared in `oidn.h` of version 2.
pub struct Api {
    new_device: unsafe extern "C" fn(c_int) -> Object,
    set_device_bool: unsafe extern "C" fn(Object, Name, bool),
    get_device_int: unsafe extern "C" fn(Object, Name) -> c_int,
    commit_device: unsafe extern "C" fn(Object),
    device_error: unsafe extern "C" fn(Object, *mut Name) -> c_int,
    release_device: unsafe extern "C" fn(Object),
    new_filter: unsafe extern "C" fn(Object, Name) -> Object,
    set_image:
        unsafe extern "C" fn(Object, Name, *mut c_void, c_int, usize, usize, usize, usize, usize),
    set_filter_bool: unsafe extern "C" fn(Object, Name, bool),
    set_filter_int: unsafe extern "C" fn(Object, Name, c_int),
    set_monitor: unsafe extern "C" fn(Object, Option<Monitor>, *mut c_void),
    commit_filter: unsafe extern "C" fn(Object),
    execute_filter: unsafe extern "C" fn(Object),
    release_filter: unsafe extern "C" fn(Object),
    /// The loaded library, to which the functions belong.
    _library: Library,
}

impl Api {
    /// Loads the library and finds its functions.
    pub fn load(path: &Path) -> Result<Api, DenoiseError> {
        let failed = |error: libloading::Error| DenoiseError::Load {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        // SAFETY: the user, or the system's search path, states that this is Open Image Denoise,
        // whose initialisation has no precondition.
        let library = unsafe { Library::new(path) }.map_err(failed)?;
        // SAFETY: each name has the type in `oidn.h` of the field that it is assigned to.
        let found = unsafe {
            Api {
                new_device: *library.get(b"oidnNewDevice\0").map_err(failed)?,
                set_device_bool: *library.get(b"oidnSetDeviceBool\0").map_err(failed)?,
                get_device_int: *library.get(b"oidnGetDeviceInt\0").map_err(failed)?,
                commit_device: *library.get(b"oidnCommitDevice\0").map_err(failed)?,
                device_error: *library.get(b"oidnGetDeviceError\0").map_err(failed)?,
                release_device: *library.get(b"oidnReleaseDevice\0").map_err(failed)?,
                new_filter: *library.get(b"oidnNewFilter\0").map_err(failed)?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0").map_err(failed)?,
                set_filter_bool: *library.get(b"oidnSetFilterBool\0").map_err(failed)?,
                set_filter_int: *library.get(b"oidnSetFilterInt\0").map_err(failed)?,
                set_monitor: *library
                    .get(b"oidnSetFilterProgressMonitorFunction\0")
                    .map_err(failed)?,
                commit_filter: *library.get(b"oidnCommitFilter\0").map_err(failed)?,
                execute_filter: *library.get(b"oidnExecuteFilter\0").map_err(failed)?,
                release_filter: *library.get(b"oidnReleaseFilter\0").map_err(failed)?,
                _library: library,
            }
        };
        Ok(found)
    }
}

/// The processor as a device of the library.
pub struct Device {
    api: Api,
    object: Object,
}

// SAFETY: the library's objects may be used from any thread (OIDN documentation, "Device").
unsafe impl Send for Device {}
// SAFETY: as above; calls lock the device.
unsafe impl Sync for Device {}

impl Device {
    pub fn new(api: Api) -> Result<Device, DenoiseError> {
        // SAFETY: the type is one of the library's.
        let object = unsafe { (api.new_device)(CPU) };
        let device = Device { api, object };
        if object.is_null() {
            return Err(device.error("no device"));
        }
        // SAFETY: the device exists, and names end with 0.
        let major = unsafe { (device.api.get_device_int)(object, c"versionMajor".as_ptr()) };
        if major != 2 {
            return Err(DenoiseError::Library(format!("version {major}, but 2 is needed")));
        }
        // SAFETY: the device exists and is not committed yet.
        unsafe {
            (device.api.set_device_bool)(object, c"setAffinity".as_ptr(), false);
            (device.api.commit_device)(object);
        }
        device.check()?;
        Ok(device)
    }

    /// Returns the library's last error, if there is one.
    fn check(&self) -> Result<(), DenoiseError> {
        let mut message: Name = std::ptr::null();
        // SAFETY: the device exists; the message is written if there is an error.
        let code = unsafe { (self.api.device_error)(self.object, &raw mut message) };
        match code {
            0 => Ok(()),
            CANCELLED => Err(DenoiseError::Ended),
            _ => Err(DenoiseError::Library(text(message, code))),
        }
    }

    fn error(&self, otherwise: &str) -> DenoiseError {
        let mut message: Name = std::ptr::null();
        // SAFETY: without a device the library reports the error of its creation.
        let code = unsafe { (self.api.device_error)(self.object, &raw mut message) };
        DenoiseError::Library(if code == 0 { otherwise.to_owned() } else { text(message, code) })
    }
}

fn text(message: Name, code: c_int) -> String {
    if message.is_null() {
        return format!("error {code}");
    }
    // SAFETY: the library's messages end with 0 and live until its next call.
    unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned()
}

impl Drop for Device {
    fn drop(&mut self) {
        if !self.object.is_null() {
            // SAFETY: the device exists, and nothing uses it any more.
            unsafe { (self.api.release_device)(self.object) };
        }
    }
}

/// A filter for ray-traced pictures.
pub struct Filter {
    device: Arc<Device>,
    object: Object,
    quality: c_int,
}

// SAFETY: as for the device.
unsafe impl Send for Filter {}

impl Filter {
    pub fn new(device: Device, quality: Quality) -> Result<Filter, DenoiseError> {
        let device = Arc::new(device);
        // SAFETY: the device is committed, and the name is one of the library's.
        let object = unsafe { (device.api.new_filter)(device.object, c"RT".as_ptr()) };
        let quality = match quality {
            Quality::Balanced => BALANCED,
            Quality::High => HIGH,
        };
        let filter = Filter { device, object, quality };
        if object.is_null() {
            return Err(filter.device.error("no filter"));
        }
        Ok(filter)
    }

    /// Filters a picture. All four have `size.0 * size.1` pixels. The library asks `goes_on` many
    /// times, from any of its threads, and ends early once it returns false.
    pub fn run(
        &mut self,
        colour: &[[f32; 3]],
        albedo: &[[f32; 3]],
        normals: &[[f32; 3]],
        output: &mut [[f32; 3]],
        (width, height): (usize, usize),
        mut goes_on: GoesOn<'_>,
    ) -> Result<(), DenoiseError> {
        let images = [
            (c"color", colour.as_ptr().cast_mut()),
            (c"albedo", albedo.as_ptr().cast_mut()),
            (c"normal", normals.as_ptr().cast_mut()),
            (c"output", output.as_mut_ptr()),
        ];
        let api = &self.device.api;
        for (name, pixels) in images {
            // SAFETY: the slices have width * height pixels, which the caller has checked, and
            // outlive the filter's run below. The library writes to `output` alone.
            unsafe {
                let pixels = pixels.cast();
                (api.set_image)(self.object, name.as_ptr(), pixels, FLOAT3, width, height, 0, 0, 0);
            }
        }
        // SAFETY: the filter exists, and its images were set above. `goes_on` outlives the run,
        // after which the monitor is removed.
        unsafe {
            (api.set_filter_bool)(self.object, c"hdr".as_ptr(), true);
            (api.set_filter_bool)(self.object, c"cleanAux".as_ptr(), true);
            (api.set_filter_int)(self.object, c"quality".as_ptr(), self.quality);
            let asked = (&raw mut goes_on).cast();
            (api.set_monitor)(self.object, Some(monitor), asked);
            (api.commit_filter)(self.object);
            (api.execute_filter)(self.object);
            (api.set_monitor)(self.object, None, std::ptr::null_mut());
        }
        self.device.check()
    }
}

/// Asks the [`GoesOn`] that `asked` points to.
///
/// # Safety
/// `asked` is valid, and only read.
unsafe extern "C" fn monitor(asked: *mut c_void, _progress: f64) -> bool {
    // SAFETY: as stated above.
    let goes_on = unsafe { &*asked.cast::<GoesOn<'_>>() };
    goes_on()
}

impl Drop for Filter {
    fn drop(&mut self) {
        if !self.object.is_null() {
            // SAFETY: the filter exists, and nothing uses it any more.
            unsafe { (self.device.api.release_filter)(self.object) };
        }
    }
}
