#include "synth/studio.h"

#include <Eigen/Geometry>
#include <cmath>

#include "calib/board/board.h"
#include "calib/board/sides.h"
#include "core/error.h"
#include "core/format.h"
#include "core/random.h"
#include "core/units.h"

namespace mvstudio::synth {
namespace {

constexpr double kSubjectHeight = 2.4;     // m, fills the image's height at the centre
constexpr double kRingAlternation = 0.65;  // m

constexpr ChoiceWords<Arrangement, 2> kArrangements = {{{Arrangement::kRing, "ring"}, {Arrangement::kDome, "dome"}}};
constexpr ChoiceWords<FootageFormat, 2> kFootageFormats = {{{FootageFormat::kMp4, "mp4"}, {FootageFormat::kPng, "png"}}};
constexpr ChoiceWords<Background, 3> kBackgrounds = {
    {{Background::kTextured, "textured"}, {Background::kPlain, "plain"}, {Background::kPosters, "posters"}}};
constexpr ChoiceWords<SubjectKind, 2> kSubjects = {{{SubjectKind::kSkinned, "skinned"}, {SubjectKind::kCloth, "cloth"}}};
constexpr ChoiceWords<TakeMotion, 2> kMotions = {{{TakeMotion::kWalk, "walk"}, {TakeMotion::kATurn, "a-turn"}}};

void Require(bool condition, const std::string& option, const std::string& expected) {
  if (!condition) throw UsageError("option '" + option + "': expected " + expected);
}

/// Distortion of an ordinary lens, parameters in the model's order.
Eigen::VectorXd Distortion(geometry::LensModel model, Rng& rng) {
  Eigen::VectorXd k(geometry::NumDistortionParams(model));
  for (int i = 0; i < k.size(); ++i) k[i] = geometry::TraitsOf(model).params[i].ordinary;
  for (int i = 0; i < k.size(); ++i) k[i] *= 1 + 0.15 * rng.Uniform(-1, 1);
  return k;
}

Eigen::Vector3d CameraPlace(const SynthOptions& o, int i, Rng& rng) {
  const double jitter = DegToRad(rng.Uniform(-3, 3)), radius = o.radius_m * (1 + 0.03 * rng.Uniform(-1, 1));
  if (o.arrangement == Arrangement::kDome) {
    constexpr double kGoldenAngle = 2.399963229728653;
    const double elevation = DegToRad(8 + 50 * (i + 0.5) / o.cameras), azimuth = kGoldenAngle * i + jitter;
    return Eigen::Vector3d(0, 0, 0.9) + radius * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                                                 std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  }
  const double azimuth = 2 * kPi * i / o.cameras + jitter;
  const double height = o.height_m + (i % 2 == 0 ? 1 : -1) * kRingAlternation + 0.05 * rng.Uniform(-1, 1);
  return {radius * std::cos(azimuth), radius * std::sin(azimuth), height};
}

geometry::Rigid3 LookAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, double roll) {
  Eigen::Matrix3d cam_from_world;
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  cam_from_world = Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()).toRotationMatrix() * cam_from_world;
  return {Eigen::Quaterniond(cam_from_world).normalized(), -(cam_from_world * eye)};
}

}  // namespace

std::string_view ToString(Arrangement arrangement) { return WordOf(kArrangements, arrangement); }
std::string_view ToString(FootageFormat format) { return WordOf(kFootageFormats, format); }
std::string_view ToString(Background background) { return WordOf(kBackgrounds, background); }
std::string_view ToString(SubjectKind subject) { return WordOf(kSubjects, subject); }
std::string_view ToString(TakeMotion motion) { return WordOf(kMotions, motion); }

void FromString(const std::string& text, Arrangement* arrangement) {
  *arrangement = KnownChoice(kArrangements, text, "option 'arrangement': expected ring or dome, not '" + text + "'");
}

void FromString(const std::string& text, FootageFormat* format) {
  *format = KnownChoice(kFootageFormats, text, "option 'format': expected mp4 or png, not '" + text + "'");
}

void FromString(const std::string& text, Background* background) {
  *background = KnownChoice(kBackgrounds, text, "option 'background': expected textured, plain or posters, not '" + text + "'");
}

void FromString(const std::string& text, SubjectKind* subject) {
  *subject = KnownChoice(kSubjects, text, "option 'subject': expected skinned or cloth, not '" + text + "'");
}

void FromString(const std::string& text, TakeMotion* motion) {
  *motion = KnownChoice(kMotions, text, "option 'take-motion': expected walk or a-turn, not '" + text + "'");
}

std::pair<int, int> ParseSize(const std::string& size) {
  int width = 0, height = 0;
  char end = 0;
  const bool ok = std::sscanf(size.c_str(), "%dx%d%c", &width, &height, &end) == 2;
  Require(ok && width >= 32 && height >= 32 && width <= 8192 && height <= 8192 && width % 2 == 0 && height % 2 == 0, "size",
          "WIDTHxHEIGHT, even numbers from 32 to 8192, not '" + size + "'");
  return {width, height};
}

void Validate(const SynthOptions& o) {
  Require(o.cameras >= 1 && o.cameras <= 200, "cameras", "1 to 200");
  Require(o.radius_m >= 1.2 && o.radius_m <= 5.5, "radius-m", "1.2 to 5.5 m (the room's wall stands at 6 m)");
  Require(o.height_m >= 0.7 && o.height_m <= 4, "height-m", "0.7 to 4 m");
  ParseSize(o.size);
  Require(geometry::LensModelFromString(o.lens).has_value() && o.lens != "splined", "lens",
          "a lens model with a fixed number of parameters, not '" + o.lens + "'");
  Require(o.focal_px == 0 || (o.focal_px >= 10 && o.focal_px <= 1e5), "focal-px", "0 or 10 to 100000");
  Require(o.noise_px >= 0 && o.noise_px < 1000, "noise-px", "0 to 1000");
  Require(o.board_frames >= 0 && o.board_frames <= 100000, "board-frames", "0 to 100000");
  Require(o.take_frames >= 0 && o.take_frames <= 100000, "take-frames", "0 to 100000");
  Require(o.new_motion_frames >= 0 && o.new_motion_frames <= 100000, "new-motion-frames", "0 to 100000");
  Require(o.new_motion_frames == 0 || o.take_frames > 0, "new-motion-frames", "a take before it, or 0");
  Require(o.fps > 0 && o.fps <= 1000, "fps", "above 0, at most 1000");
  Require(o.person_height_m >= 0.8 && o.person_height_m <= 2.3, "person-height-m", "0.8 to 2.3 m");
  Require(o.samples >= 1 && o.samples <= 8, "samples", "1 to 8");
  Require(o.texture_px >= 8 && o.texture_px <= 4096, "texture-px", "8 to 4096");
  Require(o.crf >= 0 && o.crf <= 51, "crf", "0 to 51");
  calib::RequireThickness({calib::ParseBoard(o.board)});
}

geometry::Rig MakeStudio(const SynthOptions& options, uint64_t seed) {
  Validate(options);
  const auto [width, height] = ParseSize(options.size);
  const geometry::LensModel model = *geometry::LensModelFromString(options.lens);
  const double focal = options.focal_px > 0 ? options.focal_px : height * options.radius_m / kSubjectHeight;
  Rng rng(seed * 1000003 + 17);
  geometry::Rig rig;
  rig.gauge = geometry::RigGauge::Other("truth of the synthetic studio: floor at z = 0, origin at its centre");
  for (int i = 0; i < options.cameras; ++i) {
    const std::string name = Format("cam_%02d", i + 1);
    geometry::RigCamera entry;
    const double own_focal = focal * (1 + 0.02 * rng.Uniform(-1, 1));
    entry.camera = geometry::MakePinhole(name, width, height, own_focal);
    entry.camera.model = model;
    Eigen::VectorXd params(geometry::NumParams(model));
    params.head<4>() << own_focal, own_focal * (1 + 0.001 * rng.Uniform(-1, 1)),
        entry.camera.cx() + 0.008 * width * rng.Uniform(-1, 1), entry.camera.cy() + 0.008 * width * rng.Uniform(-1, 1);
    params.tail(params.size() - 4) = Distortion(model, rng);
    entry.camera.params = params;
    // Models with xi have fx / (1 + xi) px a radian on the axis.
    entry.camera.params.head<2>() *= own_focal / geometry::PinholeOf(entry.camera).fx();
    const Eigen::Vector3d eye = CameraPlace(options, i, rng);
    const Eigen::Vector3d target(0.04 * rng.Uniform(-1, 1), 0.04 * rng.Uniform(-1, 1), 0.97 + 0.03 * rng.Uniform(-1, 1));
    entry.cam_from_world = LookAt(eye, target, DegToRad(rng.Uniform(-2, 2)));
    rig.cameras.push_back(entry);
  }
  return rig;
}

}  // namespace mvstudio::synth
