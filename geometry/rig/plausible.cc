#include "geometry/rig/plausible.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include "core/format.h"
#include "core/units.h"
#include "geometry/rig/lenses_only.h"
#include "geometry/rig/meeting.h"

namespace mvstudio::geometry {
namespace {

constexpr double kMaxDecentring = 0.05;                    // measured lenses: CMU Panoptic 0.0012, webcams 0.01
constexpr double kMaxOutside = 0.3;                        // of a side
constexpr double kMinFocal = 0.15, kMaxFocal = 30;         // of the diagonal
constexpr double kMinFocalOfWideLens = 0.05;               // all round in a circle as high as the image: 0.08
constexpr double kMaxAspect = 1.25;                        // of fx and fy; PAL's pixels are 1.09
constexpr double kMaxApart = 100;                          // m
constexpr double kMinApartPair = 0.005, kMinApart = 0.02;  // m
constexpr double kNearestMeeting = 0.03;      // m, of the axes of three cameras and more; a rig for flies has 80 mm
constexpr double kNearestMeetingOfCm = 0.08;  // m, where the file's numbers are centimetres
constexpr double kOnePlace = 1e-9;            // of the distance to the world's origin
constexpr double kMaxFoldOfWideLens = DegToRad(60);

std::string Number(double value) { return Format("%.4g", value); }

/// "camera a", "cameras a, b and c", "cameras a, b, c and 7 more".
std::string Listed(const std::vector<std::string>& names) {
  constexpr size_t kShown = 3;
  std::string text = names.size() == 1 ? "camera " : "cameras ";
  for (size_t i = 0; i < std::min(names.size(), kShown); ++i) {
    const bool last = i + 1 == names.size() && i > 0;
    text += (i == 0 ? "" : last ? " and " : ", ") + names[i];
  }
  return names.size() > kShown ? text + " and " + std::to_string(names.size() - kShown) + " more" : text;
}

double Decentring(const Camera& camera) {
  const int p1 = TraitsOf(camera.model).decentring;
  return p1 < 0 ? 0 : std::max(std::abs(camera.params[4 + p1]), std::abs(camera.params[5 + p1]));
}

/// The order that makes sense where the one read does not; empty when there is none.
std::string BetterOrder(const Camera& camera) {
  for (const TermOrder& other : OtherTermOrders(camera)) {
    if (other.camera.model == camera.model && Decentring(other.camera) < kMaxDecentring / 5 && !FoldsInside(other.camera))
      return other.name;
  }
  return "";
}

/// What is wrong with one camera, in words that follow its name; empty: nothing.
using Look = std::function<std::string(const Camera&)>;

/// One line for all cameras: the words of the first that is doubtful, the others by name.
void Report(const Rig& rig, const std::string& code, const std::string& hint, const Look& look, std::vector<Notice>* found) {
  std::vector<std::string> names;
  std::string first;
  for (const RigCamera& camera : rig.cameras) {
    const std::string words = look(camera.camera);
    if (words.empty()) continue;
    if (names.empty()) first = words;
    names.push_back(camera.camera.name);
  }
  if (names.empty()) return;
  const std::string whose = names.size() > 1 ? " (camera " + names[0] + ")" : "";
  found->push_back({code, Listed(names) + ": " + first + whose, hint});
}

std::string CheckDecentring(const Camera& camera) {
  const double p = Decentring(camera);
  if (HasLensDecentring(camera)) return "";
  const std::string order = BetterOrder(camera);
  return "a decentring (p1, p2) of " + Number(p) + " is not a lens's; 0.05 is far beyond any measured one" +
         (order.empty() ? "" : "; in the order " + order + " the terms make sense");
}

std::string CheckFold(const Camera& camera) {
  if (!FoldsInside(camera)) return "";
  return "the lens folds inside the image: " + Number(100 * ShareWithoutRay(camera)) +
         " % of it, at the corners first, belong to no direction";
}

std::string CheckCentre(const Camera& camera) {
  const auto outside = [](double center, int size) { return std::max(-center, center - size) / size; };
  if (std::max(outside(camera.cx(), camera.width_px), outside(camera.cy(), camera.height_px)) <= kMaxOutside) return "";
  return "the principal point (" + Number(camera.cx()) + ", " + Number(camera.cy()) + ") lies far outside the image of " +
         std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + " px";
}

/// The principal point is the middle of an image of the other shape, and not of this one.
std::string ExchangedSides(const Camera& camera) {
  constexpr double kNear = 0.1, kFar = 0.15, kClearly = 4;  // shares of the shorter side; how much nearer the other middle is
  const Eigen::Vector2d sides(camera.width_px, camera.height_px), at(camera.cx() + 0.5, camera.cy() + 0.5);
  const double off = (at - sides / 2).norm(), rotated_off = (at - sides.reverse() / 2).norm(), side = sides.minCoeff();
  if (rotated_off > kNear * side || off < kFar * side || off < kClearly * rotated_off) return "";
  return "the principal point (" + Number(camera.cx()) + ", " + Number(camera.cy()) + ") is the middle of an image of " +
         std::to_string(camera.height_px) + " x " + std::to_string(camera.width_px) + " px, not of " +
         std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + ": width and height are exchanged";
}

/// The principal point is the middle of an image that is smaller or larger by a common factor, and not of this one.
std::string OtherScale(const Camera& camera) {
  constexpr double kNear = 0.03;  // of a side
  constexpr double kScales[] = {0.25, 1 / 3.0, 0.5, 2 / 3.0, 1.5, 2};
  const double x = (camera.cx() + 0.5) / camera.width_px, y = (camera.cy() + 0.5) / camera.height_px;
  for (const double scale : kScales) {
    if (std::abs(x - scale / 2) > kNear * scale || std::abs(y - scale / 2) > kNear * scale) continue;
    return "the principal point (" + Number(camera.cx()) + ", " + Number(camera.cy()) + ") is the middle of an image of " +
           Number(scale * camera.width_px) + " x " + Number(scale * camera.height_px) + " px, not of " +
           std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) +
           ": another image size, or the images are cut out (ROI)";
  }
  return "";
}

/// Of one camera alone or among others it may be a crop; of most it is the calibration's size.
void CheckScale(const Rig& rig, std::vector<Notice>* found) {
  const auto count = std::count_if(rig.cameras.begin(), rig.cameras.end(),
                                   [](const RigCamera& camera) { return !OtherScale(camera.camera).empty(); });
  if (count < 2 || 2 * count <= static_cast<std::ptrdiff_t>(rig.cameras.size())) return;
  Report(rig, "CAL-SIZE",
         "the camera matrix may be that of scaled images: give their size, or bring it to this one (mvstudio calib resize)",
         OtherScale, found);
}

std::string CheckFocal(const Camera& camera) {
  const double diagonal = std::hypot(camera.width_px, camera.height_px);
  const double low = std::min(camera.fx(), camera.fy()), high = std::max(camera.fx(), camera.fy());
  const std::string focal = "fx = " + Number(camera.fx()) + " and fy = " + Number(camera.fy()) + " px";
  const std::string image = "an image of " + std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px) + " px";
  if (low < (IsWide(camera.model) ? kMinFocalOfWideLens : kMinFocal) * diagonal)
    return focal + " are shorter than any lens's for " + image;
  if (high > kMaxFocal * diagonal) {
    const double view_deg = RadToDeg(2 * std::atan(diagonal / 2 / high));
    return focal + " for " + image + " see " + Number(view_deg) + " degrees: a macro or telescope lens, or another unit";
  }
  return high > kMaxAspect * low ? focal + " differ more than any sensor's pixels do" : "";
}

double FarthestApart(const Rig& rig) {
  double farthest = 0;
  for (const RigCamera& a : rig.cameras) {
    const Eigen::Vector3d center = a.CenterInWorld();
    for (const RigCamera& b : rig.cameras) farthest = std::max(farthest, (center - b.CenterInWorld()).norm());
  }
  return farthest;
}

/// By far better than as read: cameras that follow a game over a wide field may meet roughly either way, few of them the
/// easiest. Of 12 000 such rigs, simulated, 0.2 % remain.
bool MeetsTransposed(const Rig& rig, const AxesMeeting& as_read) {
  const double clearly = rig.cameras.size() < 5 ? 0.15 : 0.2;
  const AxesMeeting transposed = MeetingOfAxes(WithRotationsTransposed(rig));
  return transposed.sharp() && transposed.in_front == static_cast<int>(rig.cameras.size()) &&
         transposed.miss_m * as_read.mean_distance_m < clearly * as_read.miss_m * transposed.mean_distance_m;
}

/// All in one place though their poses differ, or all with their backs to the point where their axes meet.
bool CheckDirections(const Rig& rig, std::vector<Notice>* conflicts) {
  const int count = static_cast<int>(rig.cameras.size());
  double farthest_world = 0;
  for (const RigCamera& camera : rig.cameras)
    farthest_world = std::max(farthest_world, camera.cam_from_world.translation.norm());
  const double apart = FarthestApart(rig);
  const bool rotated = std::any_of(rig.cameras.begin(), rig.cameras.end(), [&](const RigCamera& camera) {
    return RotationAngle(camera.cam_from_world.rotation, rig.cameras[0].cam_from_world.rotation) > kOnePlace;
  });  // otherwise these are lenses alone, without places
  const bool one_place = rotated && apart <= kOnePlace * farthest_world;
  const AxesMeeting as_read = MeetingOfAxes(rig), inverted = MeetingOfAxes(WithPosesInverted(rig));
  const bool reads_well = as_read.sharp() && 2 * as_read.in_front > count;
  const bool faces = inverted.in_front == count || inverted.in_front == 0;  // files with OpenGL's axes: all behind
  if ((one_place || count > 2) && !reads_well && inverted.sharp() && faces) {
    conflicts->push_back({"CAL-INVERTED",
                          (one_place ? "all cameras stand at one place" : "the cameras do not look at a common place") +
                              std::string("; with the poses inverted their axes meet at ") + Number(inverted.mean_distance_m) +
                              " m: does the file give poses the other way round (world from camera, or camera from world)?",
                          "option 'invert' of calib show and calib convert inverts them"});
  } else if (count > 2 && !reads_well && MeetsTransposed(rig, as_read)) {
    conflicts->push_back(
        {"CAL-TRANSPOSED",
         "the cameras do not look at a common place; with their rotations transposed their axes meet: does the "
         "file multiply rows from the right, as MATLAB does, or list columns?",
         "write the rotations with rows and columns exchanged"});
  } else if (one_place) {
    conflicts->push_back({"CAL-DISTANCES", "all cameras stand at one place (within " + Number(1000 * apart) + " mm)",
                          "points cannot be triangulated from it; check the poses"});
  } else if (count > 2 && as_read.sharp() && as_read.in_front == 0) {
    conflicts->push_back(
        {"CAL-LOOKAWAY",
         "all cameras look away from the place where their axes meet, " + Number(as_read.mean_distance_m) + " m behind",
         "nothing to do if they look outwards; else their axes may be OpenGL's (y up, looking along -z)"});
  }
  return one_place;
}

void CheckDistances(const Rig& rig, bool in_centimetres, std::vector<Notice>* conflicts) {
  if (rig.cameras.size() < 2 || CheckDirections(rig, conflicts)) return;
  const double apart = FarthestApart(rig), least = rig.cameras.size() == 2 ? kMinApartPair : kMinApart;
  const std::string hint =
      "if the unit is another: calib convert option 'unit' mm, cm or m, or the side of the board's squares";
  if (apart > kMaxApart) {
    conflicts->push_back({"CAL-DISTANCES",
                          "the cameras stand up to " + Number(apart) + " m apart; were the numbers millimetres it would be " +
                              Number(apart / 1000) + " m, centimetres " + Number(apart / 100) + " m, inches " +
                              Number(apart * 0.0254) + " m",
                          hint});
  } else if (apart > 0 && apart < least) {
    conflicts->push_back({"CAL-DISTANCES",
                          "the cameras stand no more than " + Number(1000 * apart) +
                              " mm apart; were the numbers metres, read as millimetres, it would be " + Number(1000 * apart) +
                              " m",
                          hint});
  }
  const AxesMeeting meeting = MeetingOfAxes(rig);
  const bool inward = rig.cameras.size() > 2 && meeting.sharp() && meeting.in_front == static_cast<int>(rig.cameras.size());
  if (apart >= least && inward && meeting.mean_distance_m < (in_centimetres ? kNearestMeetingOfCm : kNearestMeeting))
    conflicts->push_back({"CAL-DISTANCES",
                          "the cameras look at a place " + Number(1000 * meeting.mean_distance_m) +
                              " mm away; were the numbers metres, read as centimetres, it would be " +
                              Number(100 * meeting.mean_distance_m) + " m",
                          hint + "; Panoptic's files are centimetres (in metres they are read by option 'from' opencv)"});
}

/// Radial terms k1, k2, k3 read as k1, k2, p1, p2, k3 leave a trace even where all are small: p1 is a k3, k3 is a p2.
bool LooksShifted(const Camera& camera) {
  if (camera.model != LensModel::kBrown5) return false;
  const double p1 = camera.params[6], p2 = camera.params[7], k3 = camera.params[8];
  return k3 != 0 && std::abs(p1) > 0.01 && std::abs(p1) > 10 * std::max(std::abs(p2), std::abs(k3));
}

void CheckOrder(const Rig& rig, std::vector<Notice>* conflicts) {
  const auto shifted = std::count_if(rig.cameras.begin(), rig.cameras.end(),
                                     [](const RigCamera& camera) { return LooksShifted(camera.camera); });
  if (2 * shifted <= static_cast<std::ptrdiff_t>(rig.cameras.size())) return;
  const auto look = [](const Camera& camera) -> std::string {
    if (!LooksShifted(camera) || Decentring(camera) > kMaxDecentring) return "";
    return "p1 = " + Number(camera.params[6]) + " is far larger than p2 and k3, as when the file lists k1 k2 k3 p1 p2";
  };
  Report(rig, "CAL-TERMORDER", "compare with the program that wrote the file; here the order is k1 k2 p1 p2 k3", look,
         conflicts);
}

std::vector<TermOrder> Reordered(const Camera& camera, const std::vector<std::pair<const char*, std::vector<int>>>& orders) {
  std::vector<TermOrder> others;
  for (const auto& [name, from] : orders) {
    TermOrder& other = others.emplace_back(TermOrder{name, camera});
    for (size_t i = 0; i < from.size(); ++i) other.camera.params[4 + static_cast<Eigen::Index>(i)] = camera.params[4 + from[i]];
  }
  return others;
}

}  // namespace

std::vector<TermOrder> OtherTermOrders(const Camera& camera) {
  // For each order of the file, which of its numbers are the terms as this model lists them.
  switch (camera.model) {
    case LensModel::kBrown5:
      return Reordered(camera, {{"k1 k2 k3 p1 p2", {0, 1, 3, 4, 2}},
                                {"k1 k2 k3 p2 p1", {0, 1, 4, 3, 2}},
                                {"k1 k2 p2 p1 k3", {0, 1, 3, 2, 4}},
                                {"p1 p2 k1 k2 k3", {2, 3, 0, 1, 4}}});
    case LensModel::kRational8:
      return Reordered(camera, {{"k1 k2 k3 k4 k5 k6 p1 p2", {0, 1, 6, 7, 2, 3, 4, 5}},
                                {"k1 k2 k3 p1 p2 k4 k5 k6", {0, 1, 3, 4, 2, 5, 6, 7}}});
    case LensModel::kBrown4: {
      auto others = Reordered(camera, {{"k1 k2 p2 p1", {0, 1, 3, 2}}, {"p1 p2 k1 k2", {2, 3, 0, 1}}});
      others.push_back({"k1 k2 k3 k4 of a fisheye", camera});
      others.back().camera.model = LensModel::kKannalaBrandt4;
      return others;
    }
    case LensModel::kKannalaBrandt4: {
      TermOrder other{"k1 k2 p1 p2 of a perspective lens", camera};
      other.camera.model = LensModel::kBrown4;
      return {other};
    }
    default:
      return {};
  }
}

bool FoldsInside(const Camera& camera) {
  if (camera.model == LensModel::kSplined) return false;  // a control grid that leaves the corners out folds nowhere
  if (IsWide(camera.model) && ValidRadius(camera) > kMaxFoldOfWideLens) return false;
  return ShareWithoutRay(camera) > kFoldSlack;
}

double ShareWithoutRay(const Camera& camera) {
  constexpr int kSteps = 40;
  const Projector projector(camera);
  const auto has_ray = [&](int column, int row, int steps) {
    const Eigen::Vector2d px(-0.5 + static_cast<double>(camera.width_px) * column / steps,
                             -0.5 + static_cast<double>(camera.height_px) * row / steps);
    return projector.Unproject(px).status == Status::kOk;
  };
  int missing = 0;
  for (int i = 0; i < 9; ++i) missing += !has_ray(i % 3, i / 3, 2);
  if (missing == 0) return 0;
  missing = 0;
  for (int i = 0; i < (kSteps + 1) * (kSteps + 1); ++i) missing += !has_ray(i % (kSteps + 1), i / (kSteps + 1), kSteps);
  return static_cast<double>(missing) / ((kSteps + 1) * (kSteps + 1));
}

std::vector<Notice> ConflictsIn(const Rig& rig, bool in_centimetres) {
  std::vector<Notice> conflicts;
  const std::string compare = "compare with the program that wrote the file; calib eval tells whether images agree with it";
  Report(rig, "CAL-DECENTRING", compare + "; option 'ignore-distortion' where the images are undistorted already",
         CheckDecentring, &conflicts);
  CheckOrder(rig, &conflicts);
  Report(rig, "CAL-FOLD", "points there are left out; calibrate with boards up to the corners, or a simpler lens", CheckFold,
         &conflicts);
  Report(rig, "CAL-CENTRE", "check the size of the images and of the calibration, and that cx, cy are pixels", CheckCentre,
         &conflicts);
  CheckScale(rig, &conflicts);
  Report(rig, "CAL-SIDES",
         "exchange them in the file: NumPy and MATLAB state rows (the height) first; of photos rotated by EXIF, calibrate anew",
         ExchangedSides, &conflicts);
  Report(rig, "CAL-FOCALSIZE", "check that the focal lengths are pixels, not millimetres or parts of the image, and the size",
         CheckFocal, &conflicts);
  if (rig.gauge != kLensesOnly) CheckDistances(rig, in_centimetres, &conflicts);  // nobody stated the poses
  return conflicts;
}

bool HasLensDecentring(const Camera& camera) { return !(Decentring(camera) > kMaxDecentring); }

std::string WhyNotARotation(const Eigen::Matrix3d& matrix, double tolerance) {
  if (!matrix.allFinite()) return "not a rotation: it holds numbers that are not finite";
  const double error = (matrix * matrix.transpose() - Eigen::Matrix3d::Identity()).norm(), determinant = matrix.determinant();
  if (error < tolerance && determinant > 0) return "";
  const std::string figures = "|R R^T - I| = " + Number(error) + ", determinant " + Number(determinant);
  if (error < tolerance) {
    return "not a rotation but a reflection: " + figures + "; an axis of the camera or of the world has the wrong sign";
  }
  return "not a rotation: " + figures + "; is it scaled, or are rows and columns of other numbers?";
}

}  // namespace mvstudio::geometry
