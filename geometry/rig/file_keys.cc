#include "geometry/rig/file_keys.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include "core/error.h"
#include "core/format.h"

namespace mvstudio::geometry {
namespace {

template <size_t N>
using WordList = std::array<std::string_view, N>;

template <size_t N>
bool Has(const WordList<N>& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

constexpr WordList<15> kLensKeys = {"cameramodel",  "distortionmodel", "lensmodel",      "lenstype",  "cameratype",
                                    "fisheyemodel", "isfisheye",       "fisheye",        "lens",      "distortiontype",
                                    "usefisheye",   "projectionmodel", "projectiontype", "modeltype", "isequirectangular"};
/// Projections whose distortion's word decides.
constexpr WordList<7> kPinholes = {"pinhole", "perspective", "simplepinhole", "none", "standard", "normal", "false"};
constexpr WordList<16> kPerspectives = {"opencv",
                                        "simpleradial",
                                        "radial",
                                        "fullopencv",
                                        "plumbbob",
                                        "radtan",
                                        "brown",
                                        "radialtangential",
                                        "brownconrady",
                                        "rational",
                                        "rationalpolynomial",
                                        "brown4",
                                        "brown5",
                                        "brown3",
                                        "modifiedbrownconrady",
                                        "opencvpinhole"};
constexpr WordList<13> kFisheyes = {
    "fisheye", "equidistant", "equi", "opencvfisheye", "kannalabrandt", "kannalabrandt4",     "kb4",
    "kb",      "fisheye4",    "true", "kannala4",      "radialfisheye", "simpleradialfisheye"};

constexpr WordList<4> kSkewKeys = {"skew", "alphac", "shear", "k01"};
constexpr WordList<5> kUnitKeys = {"unit", "units", "lengthunit", "lengthunits", "distanceunit"};
constexpr WordList<2> kBinningKeys = {"binningx", "binningy"};
constexpr WordList<10> kAxesKeys = {"handedness",  "coordinatesystem",
                                    "lefthanded",  "cameraconvention",
                                    "convention",  "coordinateframe",
                                    "coordinates", "axes",
                                    "flipx",       "flipy"};
constexpr WordList<8> kOurAxes = {"opencv", "rdf", "right", "righthanded", "false", "rhs", "rh", "cv"};
constexpr WordList<6> kDirectionKeys = {"posetype",       "transformtype", "extrinsictype",
                                        "extrinsicstype", "iscamtoworld",  "camtoworld"};
constexpr WordList<7> kOurDirections = {"worldtocamera",   "worldtocam", "w2c",      "camfromworld",
                                        "camerafromworld", "false",      "extrinsic"};

/// At most 40 characters of a file's text, with '?' for whatever is not printable ASCII.
std::string Excerpt(const std::string& value) {
  std::string shown = value.substr(0, 40);
  for (char& c : shown) c = c >= ' ' && c <= '~' ? c : '?';
  return shown;
}

/// Nothing said: zero, false, none, empty, a list of zeros.
bool IsNeutral(const std::string& value) {
  const std::string plain = PlainKey(value);
  return plain.find_first_not_of('0') == std::string::npos || plain == "false" || plain == "none" || plain == "null";
}

double MetresOf(const std::string& word) {
  const std::string plain = PlainKey(word);
  const auto any = [&](auto... names) { return ((plain == names) || ...); };
  if (any("m", "meter", "meters", "metre", "metres")) return 1;
  if (any("cm", "centimeter", "centimeters", "centimetre", "centimetres")) return 0.01;
  if (any("mm", "millimeter", "millimeters", "millimetre", "millimetres")) return 0.001;
  if (any("in", "inch", "inches")) return 0.0254;
  return 0;
}

bool HoldsOneOf(const std::string& text, std::initializer_list<const char*> pieces) {
  return std::any_of(pieces.begin(), pieces.end(), [&](const char* piece) { return text.find(piece) != std::string::npos; });
}

/// Coefficients of a lens, by whatever name; not how sure they are, how many, or images without distortion.
bool NamesDistortion(const std::string& plain) {
  const bool begins = plain.rfind("dist", 0) == 0 && !HoldsOneOf(plain, {"distance", "distribution"});
  return (begins || plain == "kc" || HoldsOneOf(plain, {"distortion", "distcoef"})) &&
         !HoldsOneOf(plain,
                     {"undist", "std", "sigma", "dev", "var", "num", "error", "model", "type", "map", "valid", "rectified"});
}

/// Of a matrix its elements alone; some number in it is not zero.
bool HoldsNumber(const std::string& value) {
  const size_t data = value.find("data");
  return value.find_first_of("123456789", data == std::string::npos ? 0 : data) != std::string::npos &&
         (data != std::string::npos || value.find_first_of("0123456789-+.[") == 0);
}

/// Why the numbers mean something else; empty: they do not.
std::string OtherMeaning(const std::string& key, const std::string& value, double metres_per_unit) {
  const std::string plain = PlainKey(key), word = PlainKey(value);
  if (IsNeutral(value)) return "";
  if (Has(kLensKeys, plain) && !Has(kPinholes, word))
    return "says what kind of lens it is, which this format's reader does not know";
  if (NamesDistortion(plain) && HoldsNumber(value))
    return "is a distortion by a name that this format's reader does not know: call it distortion_coefficients (of two cameras "
           "D1 "
           "and D2)";
  if (Has(kSkewKeys, plain)) return "is a skew, which no lens model here has";
  if (plain == "xi")
    return "is the mirror of an omnidirectional lens (Mei), which this format's reader does not know; Kalibr's omni is read";
  if (Has(kBinningKeys, plain) && std::atof(value.c_str()) != 1)
    return "says that images are smaller than the calibration's: resize it (calib resize)";
  if (Has(kAxesKeys, plain) && !Has(kOurAxes, word))
    return "says that axes point otherwise than this format's; option 'mirror' reads left-handed ones";
  if (Has(kDirectionKeys, plain) && !Has(kOurDirections, word))
    return "says that poses go the other way than this format's; option 'invert' turns them round";
  const double metres = Has(kUnitKeys, plain) ? MetresOf(value) : 0;
  if (metres > 0 && std::abs(metres - metres_per_unit) > 1e-9 * metres)
    return "is not the unit in which lengths are read, " + Format("%g", metres_per_unit) + " m; give option 'unit' " + value;
  return "";
}

}  // namespace

std::string PlainKey(std::string_view key) {
  std::string plain;
  for (const char c : key) {
    if (std::isalnum(static_cast<unsigned char>(c))) plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

bool LensWords::IsKey(std::string_view key) { return Has(kLensKeys, PlainKey(key)); }

void LensWords::Add(const std::string& path, const std::string& where, std::string_view key, const std::string& value) {
  std::string word = PlainKey(value);
  if (word.empty() || word == "null") return;
  const bool number = word.find_first_not_of("0123456789") == std::string::npos;
  if (number) word = std::atof(value.c_str()) != 0 ? "true" : "false";
  const bool weak = Has(kPinholes, word);
  const LensKind kind = weak || Has(kPerspectives, word) ? LensKind::kPerspective : LensKind::kFisheye;
  if (kind == LensKind::kFisheye && (!Has(kFisheyes, word) || PlainKey(key) == "isequirectangular")) {
    throw FormatError(path, where,
                      "the lens '" + Excerpt(value) +
                          "' is not known here (pinhole, opencv, plumb_bob, rational_polynomial, radtan; fisheye, equidistant, "
                          "opencv_fisheye)");
  }
  if (weak) {
    weak_ = kind;
    return;
  }
  if (strong_ != LensKind::kUnsaid && strong_ != kind)
    throw FormatError(path, where, "'" + Excerpt(value) + "' contradicts " + said_by_ + ": is it a fisheye lens?");
  strong_ = kind;
  said_by_ = where;
}

void UnusedKeys::Add(const std::string& where, const std::string& key, const std::string& value) {
  const std::string other = OtherMeaning(key, value, metres_per_unit_);
  if (!other.empty())
    throw FormatError(path_, where, "'" + Excerpt(value) + "' " + other + "; take the key out if it does not apply");
  Seen& seen = seen_[key];
  if (seen.times++ == 0) seen.where = where;
}

std::string UnusedKeys::Text() const {
  constexpr size_t kShown = 8;
  std::string poses, others;  // what may be a pose comes first
  size_t shown = 0;
  for (const bool pose : {true, false}) {
    for (const auto& [key, seen] : seen_) {
      const bool is_pose = HoldsOneOf(PlainKey(key), {"rot", "trans", "pose", "extrinsic", "rvec", "tvec"});
      if (is_pose != pose || ++shown > kShown) continue;
      std::string& text = pose ? poses : others;
      text += (shown == 1 ? "" : ", ") + seen.where + (seen.times > 1 ? " (" + std::to_string(seen.times) + " times)" : "");
    }
  }
  return poses + others + (shown > kShown ? " and " + std::to_string(shown - kShown) + " more" : "");
}

}  // namespace mvstudio::geometry
