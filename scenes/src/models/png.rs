//! A small picture as PNG, without compression.

/// Returns tiles: 64 by 64 texels, two shades and dark joints.
pub(super) fn tiles() -> Vec<u8> {
    const SIDE: usize = 64;
    let mut rows = Vec::new();
    for y in 0..SIDE {
        rows.push(0); // no filter
        for x in 0..SIDE {
            let is_joint = x % 32 < 1 || y % 32 < 1;
            let shade = if (x / 32 + y / 32) % 2 == 0 { [178, 120, 74] } else { [206, 190, 164] };
            rows.extend(if is_joint { [60, 52, 46] } else { shade });
        }
    }
    png(SIDE as u32, SIDE as u32, &rows)
}

/// The slope of tiles towards their joints, over some texels.
const BEVEL: usize = 3;

/// Returns the normals of the tiles: flat, and sloping into the joints.
pub(super) fn tile_normals() -> Vec<u8> {
    let slope = |at: usize| match at % 32 {
        at if at < BEVEL => 180,
        at if at >= 32 - BEVEL => 76,
        _ => 128,
    };
    // The picture's rows run down, and green up.
    of_tiles(|x, y| [255 - slope(x), slope(y), 230])
}

/// Returns the roughness (green) and metalness (blue) of the tiles: dull joints, glossy tiles.
pub(super) fn tile_finish() -> Vec<u8> {
    let is_joint = |at: usize| at % 32 < 1;
    of_tiles(|x, y| [0, if is_joint(x) || is_joint(y) { 230 } else { 60 }, 0])
}

/// Returns a picture as large as that of the tiles.
fn of_tiles(texel: impl Fn(usize, usize) -> [u8; 3]) -> Vec<u8> {
    let mut rows = Vec::new();
    for y in 0..64 {
        rows.push(0); // no filter
        (0..64).for_each(|x| rows.extend(texel(x, y)));
    }
    png(64, 64, &rows)
}

fn png(width: u32, height: u32, rows: &[u8]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = [width.to_be_bytes(), height.to_be_bytes()].concat();
    header.extend([8, 2, 0, 0, 0]); // 8 bits, RGB
    chunk(&mut file, b"IHDR", &header);
    chunk(&mut file, b"IDAT", &stored(rows));
    chunk(&mut file, b"IEND", &[]);
    file
}

fn chunk(file: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    let body = [&kind[..], data].concat();
    file.extend((data.len() as u32).to_be_bytes());
    file.extend(&body);
    file.extend(crc(&body).to_be_bytes());
}

/// Returns a zlib stream of stored blocks (RFC 1950, RFC 1951 §3.2.4).
fn stored(bytes: &[u8]) -> Vec<u8> {
    let mut stream = vec![0x78, 0x01];
    let blocks = bytes.chunks(0xffff).count();
    for (number, block) in bytes.chunks(0xffff).enumerate() {
        let length = block.len() as u16;
        stream.push(u8::from(number + 1 == blocks));
        stream.extend(length.to_le_bytes());
        stream.extend((!length).to_le_bytes());
        stream.extend(block);
    }
    let (a, b) = bytes.iter().fold((1u32, 0u32), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65521;
        (a, (b + a) % 65521)
    });
    stream.extend((b << 16 | a).to_be_bytes());
    stream
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 }
        })
    })
}
