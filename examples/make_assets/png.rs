//! PNG files (ISO/IEC 15948): RGBA, 8 bits each; deflate (RFC 1951) with its fixed codes.

use std::collections::HashMap;

/// An image under construction, row by row from the top.
pub struct Image {
    pub width: usize,
    pub height: usize,
    pub texels: Vec<[u8; 4]>,
}

impl Image {
    /// Each texel by its column and row.
    pub fn new(
        width: usize,
        height: usize,
        mut texel: impl FnMut(usize, usize) -> [u8; 4],
    ) -> Self {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Self {
            width,
            height,
            texels: places.map(|(x, y)| texel(x, y)).collect(),
        }
    }

    pub fn to_png(&self) -> Vec<u8> {
        let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
        let mut header = Vec::new();
        header.extend((self.width as u32).to_be_bytes());
        header.extend((self.height as u32).to_be_bytes());
        header.extend([8, 6, 0, 0, 0]);
        chunk(&mut png, b"IHDR", &header);
        chunk(&mut png, b"IDAT", &zlib(&self.filtered()));
        chunk(&mut png, b"IEND", &[]);
        png
    }

    /// Each row as the difference to the left, to above, or as it is: whichever is smallest.
    fn filtered(&self) -> Vec<u8> {
        let mut above = vec![0; 4 * self.width];
        let mut out = Vec::new();
        for row in self.texels.chunks_exact(self.width) {
            let row = row.concat();
            let left = |i: usize| if i < 4 { 0 } else { row[i - 4] };
            let ways = [0, 1, 2].map(|way| {
                let difference = |(i, x): (usize, &u8)| match way {
                    0 => *x,
                    1 => x.wrapping_sub(left(i)),
                    _ => x.wrapping_sub(above[i]),
                };
                let bytes: Vec<u8> = row.iter().enumerate().map(difference).collect();
                let cost = |x: &u8| u32::from((*x as i8).unsigned_abs());
                (bytes.iter().map(cost).sum::<u32>(), way, bytes)
            });
            if let Some((_, way, bytes)) = ways.into_iter().min() {
                out.push(way);
                out.extend(bytes);
            }
            above = row;
        }
        out
    }
}

fn chunk(png: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    png.extend((data.len() as u32).to_be_bytes());
    let start = png.len();
    png.extend(kind);
    png.extend(data);
    let crc = !png[start..].iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| {
            (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg())
        })
    });
    png.extend(crc.to_be_bytes());
}

fn zlib(data: &[u8]) -> Vec<u8> {
    let mut out = vec![0x78, 0x9c];
    out.extend(deflate(data));
    let (a, b) = data.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65521;
        (a, (b + a) % 65521)
    });
    out.extend((b << 16 | a).to_be_bytes());
    out
}

#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    used: u32,
}

impl Bits {
    /// The lowest bit first.
    fn put(&mut self, value: u32, count: u32) {
        for i in 0..count {
            if self.used.is_multiple_of(8) {
                self.bytes.push(0);
            }
            if let Some(last) = self.bytes.last_mut() {
                *last |= ((value >> i & 1) as u8) << (self.used % 8);
            }
            self.used += 1;
        }
    }

    /// A Huffman code: the highest bit first.
    fn code(&mut self, value: u32, count: u32) {
        self.put(value.reverse_bits() >> (32 - count), count);
    }

    /// A literal or length symbol in the fixed code.
    fn symbol(&mut self, symbol: u32) {
        match symbol {
            0..144 => self.code(0x30 + symbol, 8),
            144..256 => self.code(0x190 + symbol - 144, 9),
            256..280 => self.code(symbol - 256, 7),
            _ => self.code(0xc0 + symbol - 280, 8),
        }
    }
}

/// One block; each place takes the latest match for its three bytes.
fn deflate(data: &[u8]) -> Vec<u8> {
    let mut bits = Bits::default();
    bits.put(0b011, 3);
    let mut latest: HashMap<[u8; 3], usize> = HashMap::new();
    let mut at = 0;
    while at < data.len() {
        let key = |i: usize| Some([*data.get(i)?, *data.get(i + 1)?, *data.get(i + 2)?]);
        let from = key(at).and_then(|k| latest.get(&k).copied());
        let length = match from {
            Some(from) if at - from <= 32768 => (data[at..].iter().zip(&data[from..]))
                .take(258)
                .take_while(|(a, b)| a == b)
                .count(),
            _ => 0,
        };
        let step = match from {
            Some(from) if length >= 3 => {
                put_match(&mut bits, length as u32, (at - from) as u32);
                length
            }
            _ => {
                bits.symbol(u32::from(data[at]));
                1
            }
        };
        for i in at..at + step {
            if let Some(k) = key(i) {
                latest.insert(k, i);
            }
        }
        at += step;
    }
    bits.symbol(256);
    bits.bytes
}

fn put_match(bits: &mut Bits, length: u32, distance: u32) {
    if length == 258 {
        bits.symbol(285);
    } else {
        // Each four symbols have one more extra bit than those before; the first eight have none.
        let x = length - 3;
        let extra = x.max(4).ilog2() - 2;
        bits.symbol(257 + 4 * extra + (x >> extra));
        bits.put(x & ((1 << extra) - 1), extra);
    }
    // The same with two symbols each.
    let x = distance - 1;
    let extra = x.max(2).ilog2() - 1;
    bits.code(2 * extra + (x >> extra), 5);
    bits.put(x & ((1 << extra) - 1), extra);
}
