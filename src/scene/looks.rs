use glam::{DVec2, DVec3};

use super::procedural::lattice_hash;
use super::{Heterogeneity, SurfaceLight, Transfer};

/// How single scattering is bent beyond what is physical (Kol et al. 2017, sec. 4).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Looks {
    /// Edits of what casts shadows in the air, one after the other. Surfaces keep the shadows that they have.
    pub occluders: Vec<OccluderEdit>,
    /// Transfer functions with their shares, which add up to 1; none where scattered light is as it is.
    pub transfer: Vec<(f64, Transfer)>,
    /// How irregular the air is, with shares that add up to 1 at most; the rest, or all where there is none, is even air.
    pub heterogeneity: Vec<(f64, Heterogeneity)>,
    /// How light from everywhere arrives at surfaces, with shares that add up to 1 at most; the rest, or all where there is none, is the same ambient light on all.
    pub surfaces: Vec<(f64, SurfaceLight)>,
}

/// A kind of look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// Filled holes.
    Fill,
    /// Extruded silhouettes.
    Extrude,
    /// Holes that are made.
    Pierce,
    /// Transfer functions.
    Transfer,
    /// Heterogeneity of the air.
    Heterogeneity,
    /// Light from everywhere on surfaces.
    Surfaces,
}

impl Looks {
    /// What there is, in a few words; none where light is as it is.
    pub fn in_words(&self) -> Option<String> {
        let of_edit = |edit: &OccluderEdit| {
            let what = match &edit.kind {
                OccluderEditKind::Fill(kernel, radius) => {
                    let kernel = match kernel {
                        Kernel::Disc => "a disc",
                        Kernel::Square => "a square",
                        Kernel::Lines(_) => "lines",
                    };
                    format!("holes filled with {kernel} of {}", radius.in_words())
                }
                OccluderEditKind::Extrude { radius, .. } => {
                    format!("silhouettes extruded by {}", radius.in_words())
                }
                OccluderEditKind::Pierce(holes) => {
                    let count = holes.pierced.iter().filter(|pierced| **pierced).count();
                    format!("{count} of {} triangles pierced", holes.pierced.len())
                }
            };
            if edit.strength < 1.0 { format!("{what} ({:.0} %)", 100.0 * edit.strength) } else { what }
        };
        let of_function = |(share, transfer): &(f64, Transfer)| {
            let Transfer { size: [width, height], strength, .. } = transfer;
            format!("a transfer function of {width} × {height} ({:.0} %)", 100.0 * share * strength)
        };
        let of_air = |(share, air): &(f64, Heterogeneity)| match *share {
            1.0 => air.in_words(),
            share => format!("{} ({:.0} %)", air.in_words(), 100.0 * share),
        };
        let of_surfaces = |(share, light): &(f64, SurfaceLight)| match *share {
            1.0 => light.in_words(),
            share => format!("{} ({:.0} %)", light.in_words(), 100.0 * share),
        };
        let edits = self.occluders.iter().map(of_edit).chain(self.transfer.iter().map(of_function));
        let edits = edits.chain(self.heterogeneity.iter().map(of_air));
        let words: Vec<String> = edits.chain(self.surfaces.iter().map(of_surfaces)).collect();
        (!words.is_empty()).then(|| words.join(", then "))
    }

    /// The same without some kinds.
    pub fn without(&self, kinds: &[Look]) -> Self {
        let stays = |edit: &&OccluderEdit| {
            let kind = match edit.kind {
                OccluderEditKind::Fill(..) => Look::Fill,
                OccluderEditKind::Extrude { .. } => Look::Extrude,
                OccluderEditKind::Pierce(_) => Look::Pierce,
            };
            !kinds.contains(&kind)
        };
        Self {
            occluders: self.occluders.iter().filter(stays).cloned().collect(),
            transfer: if kinds.contains(&Look::Transfer) { Vec::new() } else { self.transfer.clone() },
            heterogeneity: match kinds.contains(&Look::Heterogeneity) {
                true => Vec::new(),
                false => self.heterogeneity.clone(),
            },
            surfaces: if kinds.contains(&Look::Surfaces) { Vec::new() } else { self.surfaces.clone() },
        }
    }
}

/// An edit of a shadow map.
#[derive(Debug, Clone, PartialEq)]
pub struct OccluderEdit {
    /// What it does.
    pub kind: OccluderEditKind,
    /// How far depths go towards the edited ones, from 0 to 1.
    pub strength: f64,
}

/// What an edit of a shadow map does.
#[derive(Debug, Clone, PartialEq)]
pub enum OccluderEditKind {
    /// Closes holes that are narrower than the kernel: dilation by the least, then erosion by the largest depth.
    Fill(Kernel, Radius),
    /// Extrudes what casts shadows along the view rays of an eye, away from it, where it is hidden behind what the eye sees (eq. 3).
    Extrude {
        /// The eye, in world space.
        eye: DVec3,
        /// How far, along the shadow map.
        radius: Radius,
    },
    /// Makes holes.
    Pierce(Holes),
}

/// Which texels are the neighbours of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// Those in a disc.
    Disc,
    /// Those in a square.
    Square,
    /// Those towards an eye, in world space: depths follow its view rays, as in eq. 3, so that what is filled is hidden behind what it sees.
    Lines(DVec3),
}

/// How far a kernel reaches from its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Radius {
    /// In texels of the shadow map.
    Texels(f64),
    /// In metres.
    Metres(f64),
}

impl Radius {
    fn in_words(self) -> String {
        match self {
            Self::Texels(texels) => format!("{texels} texels"),
            Self::Metres(length) => format!("{length} units"),
        }
    }
}

/// Holes where noise is below a threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct Holes {
    /// Which triangles have them.
    pub pierced: Vec<bool>,
    /// What makes them, over the plane that light passes perpendicularly.
    pub noise: HoleNoise,
    /// The share of the plane that they take.
    pub share: f64,
    /// Noise below it is a hole: h, see [`HoleNoise::threshold`].
    pub threshold: f64,
    /// A second lookup that moves them about; none where they stand still.
    pub sway: Option<Sway>,
}

/// Octaves of Perlin's noise over a plane (eq. 5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoleNoise {
    /// The side of a cell of the first octave in metres: 1 / (g f).
    pub size: f64,
    /// o.
    pub octaves: u32,
    /// The factor from one octave to the next, whose cells have half the side: p.
    pub persistence: f64,
    /// Other numbers give other noise.
    pub seed: u32,
}

/// How the noise of turned places moves others (sec. 4.1, animated holes).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sway {
    /// By how much places are turned about the origin before the first lookup, in radians: the time.
    pub turn: f64,
    /// How far the noise found there moves the second lookup, in cells.
    pub amount: f64,
}

/// Places a side at which thresholds are found.
const SAMPLED: usize = 256;

impl Looks {
    /// The looks a `share` of the way to others. Transfer functions are blended: both apply, each with its part.
    ///
    /// Edits of the same kinds in the same order, which differ in numbers alone, have the numbers between. Others fade out by their strength,
    /// while those that take their place fade in.
    pub fn between(&self, to: &Self, share: f64) -> Self {
        let pairs = self.occluders.iter().zip(&to.occluders);
        let is_paired = self.occluders.len() == to.occluders.len();
        let paired = pairs.map(|(from, to)| from.between(to, share)).collect::<Option<Vec<_>>>();
        let occluders = paired.filter(|_| is_paired).unwrap_or_else(|| {
            let [out, into] = [(self, 1.0 - share), (to, share)]
                .map(|(looks, part)| looks.occluders.iter().map(move |edit| edit.weakened(part)));
            out.chain(into).collect()
        });
        Self {
            occluders,
            transfer: blended(&self.transfer, &to.transfer, share),
            heterogeneity: drifted(&self.heterogeneity, &to.heterogeneity, share),
            surfaces: parts(&self.surfaces, &to.surfaces, share),
        }
    }
}

/// Air between two such lists: noise that has moved alone moves, else both are there, each with its part.
fn drifted(
    from: &[(f64, Heterogeneity)],
    to: &[(f64, Heterogeneity)],
    share: f64,
) -> Vec<(f64, Heterogeneity)> {
    if let ([(1.0, here)], [(1.0, there)]) = (from, to)
        && let Some(between) = here.moved_to(there, share)
    {
        return vec![(1.0, between)];
    }
    parts(from, to, share)
}

/// All of two lists, each with its part; the same where they are.
fn parts<T: Clone + PartialEq>(from: &[(f64, T)], to: &[(f64, T)], share: f64) -> Vec<(f64, T)> {
    if from == to {
        return from.to_vec();
    }
    let part = |list: &[(f64, T)], part: f64| {
        list.iter().map(move |(own, it)| (part * own, it.clone())).collect::<Vec<_>>()
    };
    [part(from, 1.0 - share), part(to, share)].concat()
}

/// Transfer functions between two such lists; where one has none, light is as it is.
fn blended(from: &[(f64, Transfer)], to: &[(f64, Transfer)], share: f64) -> Vec<(f64, Transfer)> {
    if from == to {
        return from.to_vec();
    }
    let none = [(1.0, Transfer::none())];
    let [from, to] = [from, to].map(|list| if list.is_empty() { &none[..] } else { list });
    parts(from, to, share)
}

impl OccluderEdit {
    /// The edit a `share` of the way to another; none where they differ in more than numbers.
    fn between(&self, to: &Self, share: f64) -> Option<Self> {
        use OccluderEditKind::{Extrude, Fill, Pierce};
        let eye = |from: DVec3, to: DVec3| from.lerp(to, share);
        let kind = match (&self.kind, &to.kind) {
            (Fill(from, a), Fill(to, b)) => {
                let kernel = match (from, to) {
                    (Kernel::Lines(from), Kernel::Lines(to)) => Kernel::Lines(eye(*from, *to)),
                    _ if from == to => *from,
                    _ => return None,
                };
                Fill(kernel, a.between(*b, share)?)
            }
            (Extrude { eye: from, radius: a }, Extrude { eye: to, radius: b }) => {
                Extrude { eye: eye(*from, *to), radius: a.between(*b, share)? }
            }
            (Pierce(from), Pierce(to)) => Pierce(from.between(to, share)?),
            _ => return None,
        };
        Some(Self { kind, strength: lerp(self.strength, to.strength, share) })
    }

    /// The same, a part as strong.
    fn weakened(&self, part: f64) -> Self {
        Self { kind: self.kind.clone(), strength: part * self.strength }
    }
}

impl Radius {
    /// The radius a `share` of the way to another; none where they are of different units.
    fn between(self, to: Self, share: f64) -> Option<Self> {
        match (self, to) {
            (Self::Texels(from), Self::Texels(to)) => Some(Self::Texels(lerp(from, to, share))),
            (Self::Metres(from), Self::Metres(to)) => Some(Self::Metres(lerp(from, to, share))),
            _ => None,
        }
    }
}

/// The number a `share` of the way to another; the same where they are.
fn lerp(from: f64, to: f64, share: f64) -> f64 {
    from + share * (to - from)
}

impl HoleNoise {
    /// N at a place in metres: Σᵢ pⁱ P(2ⁱ q) / max(1, o − i − 1), q in cells.
    pub fn at(&self, place: DVec2) -> f64 {
        self.at_cells(place / self.size)
    }

    fn at_cells(&self, q: DVec2) -> f64 {
        let octave = |i: u32| {
            let share =
                self.persistence.powi(i as i32) / f64::from(self.octaves.saturating_sub(i + 1).max(1));
            share * gradient_noise(q * f64::from(i).exp2(), self.seed.wrapping_add(i))
        };
        (0..self.octaves).map(octave).sum()
    }

    /// The threshold below which the noise is on a share of the plane.
    pub fn threshold(&self, share: f64) -> f64 {
        // Places of an irrational lattice, which meets all parts of cells alike.
        let place = |index: usize| {
            let [i, j] = [index % SAMPLED, index / SAMPLED].map(|i| i as f64);
            DVec2::new(i * 0.618_033_988_75, j * 0.754_877_666_25)
        };
        let mut values: Vec<f64> = (0..SAMPLED * SAMPLED).map(|index| self.at_cells(place(index))).collect();
        values.sort_by(f64::total_cmp);
        let below = (share.clamp(0.0, 1.0) * values.len() as f64).round() as usize;
        match below {
            0 => f64::NEG_INFINITY,
            below if below == values.len() => f64::INFINITY,
            below => 0.5 * (values[below - 1] + values[below]),
        }
    }
}

impl Holes {
    /// Holes by a noise on a `share` of the plane.
    pub fn new(pierced: Vec<bool>, noise: HoleNoise, share: f64, sway: Option<Sway>) -> Self {
        Self { pierced, noise, share, threshold: noise.threshold(share), sway }
    }

    /// The holes a `share` of the way to others; none where other triangles have them, or noise that is not of the same octaves and seed.
    fn between(&self, to: &Self, share: f64) -> Option<Self> {
        let (a, b) = (&self.noise, &to.noise);
        if self.pierced != to.pierced || (a.octaves, a.seed) != (b.octaves, b.seed) {
            return None;
        }
        let (size, persistence) = (lerp(a.size, b.size, share), lerp(a.persistence, b.persistence, share));
        let noise = HoleNoise { size, persistence, ..*a };
        // Holes that stand still sway by nothing, at any time.
        let still = |sway: Sway| Sway { amount: 0.0, ..sway };
        let sways = match (self.sway, to.sway) {
            (None, None) => None,
            (Some(from), None) => Some((from, still(from))),
            (None, Some(to)) => Some((still(to), to)),
            (Some(from), Some(to)) => Some((from, to)),
        };
        let sway = sways.map(|(from, to)| Sway {
            turn: lerp(from.turn, to.turn, share),
            amount: lerp(from.amount, to.amount, share),
        });
        if (noise, self.share) == (self.noise, to.share) {
            return Some(Self { sway, ..self.clone() });
        }
        Some(Self::new(self.pierced.clone(), noise, lerp(self.share, to.share, share), sway))
    }

    /// Whether there is a hole at a place of the light's plane, in metres (eq. 4).
    pub fn is_hole(&self, place: DVec2) -> bool {
        let q = place / self.noise.size;
        let q = self.sway.map_or(q, |Sway { turn, amount }| {
            let turned = DVec2::from_angle(turn).rotate(q);
            q + amount * self.noise.at_cells(turned) * DVec2::from_angle(turn)
        });
        self.noise.at_cells(q) < self.threshold
    }
}

/// Perlin's gradient noise over a plane (1985, with the fade of 2002), with hashed gradients of length √2.
fn gradient_noise(p: DVec2, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |i: f64, j: f64| gradient(cell + DVec2::new(i, j), seed).dot(f - DVec2::new(i, j));
    let along = |j: f64| (1.0 - fade.x) * corner(0.0, j) + fade.x * corner(1.0, j);
    (1.0 - fade.y) * along(0.0) + fade.y * along(1.0)
}

/// One of eight directions, by a hash of the lattice point.
fn gradient(point: DVec2, seed: u32) -> DVec2 {
    let hash = lattice_hash(&point.to_array(), seed);
    std::f64::consts::SQRT_2 * DVec2::from_angle(f64::from(hash >> 8 & 7) * std::f64::consts::FRAC_PI_4)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(octaves: u32) -> HoleNoise {
        HoleNoise { size: 0.5, octaves, persistence: 0.5, seed: 7 }
    }

    #[test]
    fn octaves_add_up_as_equation_5_says() {
        let place = DVec2::new(1.37, -2.11);
        let one = |i: i32| gradient_noise(place / 0.5 * f64::from(1 << i), 7 + i as u32);
        let by_hand =
            one(0) / 4.0 + 0.5 * one(1) / 3.0 + 0.25 * one(2) / 2.0 + 0.125 * one(3) + 0.0625 * one(4);
        assert!((noise(5).at(place) - by_hand).abs() < 1e-15);
        assert_eq!(noise(1).at(place), one(0));
        // Nothing at the points of the lattice, and no jump from cell to cell.
        assert_eq!(gradient_noise(DVec2::new(3.0, -8.0), 1), 0.0);
        for x in [-2.0, 0.0, 5.0] {
            let [below, above] = [x - 1e-9, x + 1e-9].map(|x| gradient_noise(DVec2::new(x, 0.3), 1));
            assert!((below - above).abs() < 1e-8);
        }
    }

    #[test]
    fn holes_cover_the_share_that_is_asked_for() {
        for (octaves, share) in [(1, 0.2), (3, 0.5), (5, 0.8)] {
            let noise = noise(octaves);
            let holes = |sway| Holes::new(Vec::new(), noise, share, sway);
            let moved = Sway { turn: 0.7, amount: 0.8 };
            for (holes, bound) in [(holes(None), 0.01), (holes(Some(moved)), 0.1)] {
                let side = 500;
                let is_hole =
                    |k: usize| holes.is_hole(DVec2::new((k % side) as f64, (k / side) as f64) * 0.171);
                let found = (0..side * side).filter(|&k| is_hole(k)).count() as f64 / (side * side) as f64;
                assert!((found - share).abs() < bound, "{octaves} octaves, {share}: {found}");
            }
        }
        assert_eq!(noise(3).threshold(0.0), f64::NEG_INFINITY);
        assert_eq!(noise(3).threshold(1.0), f64::INFINITY);
    }

    fn edit(kind: OccluderEditKind, strength: f64) -> OccluderEdit {
        OccluderEdit { kind, strength }
    }

    #[test]
    fn edits_that_differ_in_numbers_alone_have_those_between() {
        let pierce = |share, sway| {
            let noise = HoleNoise { size: 1.0 + share, ..noise(3) };
            edit(OccluderEditKind::Pierce(Holes::new(vec![true], noise, share, sway)), 1.0)
        };
        let fill =
            |radius, strength| edit(OccluderEditKind::Fill(Kernel::Disc, Radius::Texels(radius)), strength);
        let looks = |occluders| Looks { occluders, ..Looks::default() };
        let from = looks(vec![fill(2.0, 1.0), pierce(0.25, None)]);
        let to = looks(vec![fill(6.0, 0.5), pierce(0.75, Some(Sway { turn: 3.0, amount: 0.5 }))]);
        let middle = from.between(&to, 0.25);
        let sway = Some(Sway { turn: 3.0, amount: 0.125 });
        assert_eq!(middle, looks(vec![fill(3.0, 0.875), pierce(0.375, sway)]));
        assert_eq!(from.between(&from, 0.3), from, "what does not change stays, to the bit");

        // Others fade: those of the first key out, those of the second in.
        let square = edit(OccluderEditKind::Fill(Kernel::Square, Radius::Texels(2.0)), 0.5);
        for (other, faded) in [
            (vec![square.clone()], vec![edit(square.kind.clone(), 0.125)]),
            (
                vec![edit(OccluderEditKind::Fill(Kernel::Disc, Radius::Metres(2.0)), 1.0)],
                vec![edit(OccluderEditKind::Fill(Kernel::Disc, Radius::Metres(2.0)), 0.25)],
            ),
            (Vec::new(), Vec::new()),
        ] {
            let from = looks(vec![fill(2.0, 1.0)]);
            let expected = [vec![fill(2.0, 0.75)], faded].concat();
            assert_eq!(from.between(&looks(other), 0.25).occluders, expected);
        }
    }

    #[test]
    fn transfer_functions_have_parts_that_add_up_to_one() {
        let strong = |strength| Transfer { strength, ..Transfer::none() };
        let looks = |transfer| Looks { transfer, ..Looks::default() };
        let (from, to) =
            (looks(vec![(1.0, strong(0.5))]), looks(vec![(0.25, strong(0.1)), (0.75, strong(0.2))]));
        let middle = from.between(&to, 0.5).transfer;
        assert_eq!(middle, [(0.5, strong(0.5)), (0.125, strong(0.1)), (0.375, strong(0.2))]);
        // Without one light is as it is.
        let plain = looks(Vec::new());
        assert_eq!(plain.between(&from, 0.75).transfer, [(0.25, Transfer::none()), (0.75, strong(0.5))]);
        assert_eq!((plain.between(&plain, 0.5), from.between(&from, 0.5)), (plain, from));
    }
}
