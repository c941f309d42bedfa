#include "stages/people/feet_floor.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "core/format.h"
#include "core/statistics.h"
#include "core/units.h"

namespace mvstudio::stages {
namespace {

using Eigen::Index;
using Eigen::Vector3d;

constexpr std::array<const char*, 4> kFootJoints = {"Ankle", "Heel", "BigToe", "SmallToe"};
constexpr size_t kKinds = kFootJoints.size();
constexpr double kNearM = 0.03;

/// Where a joint stood, and when.
struct Stop {
  int begin = 0, end = 0, frames = 0;
  Vector3d x = Vector3d::Zero();
};

/// Where a joint of a foot stood.
struct Place {
  size_t kind = 0;
  double side = 1;  // left 1, right -1
  int person = 0;
  Stop stop;
  Vector3d x = Vector3d::Zero();
  int block = 0;  // of the jackknife
};

using Track = std::vector<std::pair<int, Vector3d>>;          // by frame
using Tracks = std::map<std::pair<int, std::string>, Track>;  // of a person's joint

Tracks TracksOf(const dataset::Pose3d& pose) {
  Tracks tracks;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status == Status::kOk && row.x_in_world.allFinite())
      tracks[{row.person, row.joint}].emplace_back(row.frame, row.x_in_world);
  }
  return tracks;
}

/// Stretches of five frames or more in which the joint stays within 4 cm of their mean.
std::vector<Stop> Stops(const Track& track) {
  constexpr double kStillM = 0.04;
  constexpr int kFewest = 5, kMostGap = 2;
  std::vector<Stop> stops;
  Stop now;
  const auto close = [&] {
    if (now.frames >= kFewest) stops.push_back(now), stops.back().x /= now.frames;
    now = {};
  };
  for (const auto& [frame, x] : track) {
    if (now.frames > 0 && (frame - now.end > kMostGap || (x - now.x / now.frames).norm() > kStillM)) close();
    if (now.frames == 0) now.begin = frame;
    now.x += x, ++now.frames, now.end = frame;
  }
  close();
  return stops;
}

/// Without those that last less than half of the median: feet that hover.
std::vector<Place> LongOnes(std::vector<Place> places) {
  std::vector<int> lengths;
  for (const Place& place : places) lengths.push_back(place.stop.frames);
  const double shortest = 0.5 * LinearQuantile(lengths, 0.5);
  places.erase(std::remove_if(places.begin(), places.end(), [&](const Place& p) { return p.stop.frames < shortest; }),
               places.end());
  return places;
}

/// Joints of one foot that stand at the same time belong together; these stands, in the order of time, make up to 20 blocks.
/// Returns their number.
int MakeBlocks(std::vector<Place>* places) {
  constexpr int kMostBlocks = 20;
  const auto key = [](const Place& p) { return std::make_tuple(p.person, p.side, p.stop.begin); };
  std::sort(places->begin(), places->end(), [&](const Place& a, const Place& b) { return key(a) < key(b); });
  std::vector<std::pair<int, std::vector<Place*>>> stands;  // by first frame
  int end = 0;
  for (size_t i = 0; i < places->size(); ++i) {
    Place& place = (*places)[i];
    const bool same =
        i > 0 && place.person == places->at(i - 1).person && place.side == places->at(i - 1).side && place.stop.begin <= end;
    if (!same) stands.push_back({place.stop.begin, {}});
    stands.back().second.push_back(&place);
    end = same ? std::max(end, place.stop.end) : place.stop.end;
  }
  std::sort(stands.begin(), stands.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  const int blocks = std::min(kMostBlocks, static_cast<int>(stands.size()));
  for (size_t k = 0; k < stands.size(); ++k) {
    for (Place* place : stands[k].second) place->block = static_cast<int>(k) * blocks / static_cast<int>(stands.size());
  }
  return blocks;
}

std::vector<Place> PlacesOf(const Tracks& tracks) {
  std::vector<Place> places;
  for (const auto& [who, track] : tracks) {
    for (size_t kind = 0; kind < kKinds; ++kind) {
      for (const auto& [letter, side] : {std::pair{"L", 1.0}, std::pair{"R", -1.0}}) {
        if (who.second != std::string(letter) + kFootJoints[kind]) continue;
        for (const Stop& stop : Stops(track)) places.push_back({kind, side, who.first, stop, stop.x, 0});
      }
    }
  }
  return LongOnes(places);
}

/// Mean direction from ankles to hips, a unit vector; zero where no leg is seen.
Vector3d LegsUp(const Tracks& tracks) {
  Vector3d sum = Vector3d::Zero();
  for (const auto& [who, hips] : tracks) {
    if (who.second != "LHip" && who.second != "RHip") continue;
    const auto ankles = tracks.find({who.first, who.second.substr(0, 1) + "Ankle"});
    if (ankles == tracks.end()) continue;
    size_t a = 0;
    for (const auto& [frame, hip] : hips) {
      while (a < ankles->second.size() && ankles->second[a].first < frame) ++a;
      if (a < ankles->second.size() && ankles->second[a].first == frame)
        sum += (hip - ankles->second[a].second).stableNormalized();
    }
  }
  return sum.norm() > 0 ? Vector3d(sum.normalized()) : sum;
}

/// Median of thigh plus shank over people, frames and sides, metres; NaN where none is seen.
double LegLength(const Tracks& tracks) {
  std::vector<double> lengths;
  for (const auto& [who, hips] : tracks) {
    if (who.second != "LHip" && who.second != "RHip") continue;
    const std::string side = who.second.substr(0, 1);
    const auto knees = tracks.find({who.first, side + "Knee"}), ankles = tracks.find({who.first, side + "Ankle"});
    if (knees == tracks.end() || ankles == tracks.end()) continue;
    const std::map<int, Vector3d> knee(knees->second.begin(), knees->second.end()),
        ankle(ankles->second.begin(), ankles->second.end());
    for (const auto& [frame, hip] : hips) {
      const auto k = knee.find(frame), a = ankle.find(frame);
      if (k != knee.end() && a != ankle.end()) lengths.push_back((hip - k->second).norm() + (k->second - a->second).norm());
    }
  }
  return LinearQuantile(lengths, 0.5);
}

/// Parallel planes in a frame whose z is nearly their normal: z = slope . (x, y) + level[kind].
struct Planes {
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
  std::array<double, kKinds> level{};
  Eigen::MatrixXd inverse;  // (2 + kinds, 2 + kinds) of the normal equations
  bool ok = false;
};

double Above(const Planes& planes, const Place& place) {
  return place.x.z() - planes.slope.dot(place.x.head<2>()) - planes.level[place.kind];
}

Eigen::VectorXd RowOf(const Place& place) {
  Eigen::VectorXd row = Eigen::VectorXd::Zero(2 + static_cast<Index>(kKinds));
  row.head<2>() = place.x.head<2>(), row[2 + static_cast<Index>(place.kind)] = 1;
  return row;
}

/// Weighted least squares; kinds without places keep level 0.
Planes Solve(const std::vector<Place>& places, const std::vector<double>& weights) {
  constexpr Index kUnknowns = 2 + static_cast<Index>(kKinds);
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(kUnknowns, kUnknowns);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(kUnknowns);
  for (size_t i = 0; i < places.size(); ++i) {
    const Eigen::VectorXd row = RowOf(places[i]);
    h += weights[i] * row * row.transpose(), g += weights[i] * places[i].x.z() * row;
  }
  for (Index k = 2; k < kUnknowns; ++k) {
    if (h(k, k) == 0) h(k, k) = 1;
  }
  const Eigen::LDLT<Eigen::MatrixXd> factor(h);
  Planes planes;
  const Eigen::VectorXd solution = factor.solve(g);
  planes.inverse = factor.solve(Eigen::MatrixXd::Identity(kUnknowns, kUnknowns));
  planes.ok = factor.info() == Eigen::Success && factor.isPositive() && planes.inverse.allFinite() && solution.allFinite() &&
              (h * planes.inverse - Eigen::MatrixXd::Identity(kUnknowns, kUnknowns)).norm() < 1e-6;
  planes.slope = solution.head<2>();
  for (size_t k = 0; k < kKinds; ++k) planes.level[k] = solution[2 + static_cast<Index>(k)];
  return planes;
}

/// Regression of the 0.3-quantile by reweighted least squares: lifted feet lie above.
Planes LowerPlanes(const std::vector<Place>& places) {
  constexpr double kQuantile = 0.3, kSmoothM = 2e-3;
  constexpr int kRounds = 60;
  std::vector<double> weights(places.size(), 1);
  Planes planes;
  for (int round = 0; round < kRounds; ++round) {
    planes = Solve(places, weights);
    if (!planes.ok) return planes;
    for (size_t i = 0; i < places.size(); ++i) {
      const double above = Above(planes, places[i]);
      weights[i] = (above > 0 ? kQuantile : 1 - kQuantile) / std::max(std::abs(above), kSmoothM);
    }
  }
  return planes;
}

std::vector<Place> Near(const Planes& planes, const std::vector<Place>& places) {
  std::vector<Place> near;
  for (const Place& place : places) {
    if (std::abs(Above(planes, place)) < kNearM) near.push_back(place);
  }
  return near;
}

/// Least squares over the places within 3 cm of it; `used` receives these.
Planes FitPlanes(const std::vector<Place>& places, std::vector<Place>* used) {
  Planes planes = LowerPlanes(places);
  constexpr int kRounds = 10;
  for (int round = 0; round < kRounds && planes.ok; ++round) {
    *used = Near(planes, places);
    planes = Solve(*used, std::vector<double>(used->size(), 1));
  }
  return planes;
}

/// Rotation that turns `up` to z by the shortest way.
Eigen::Quaterniond ToUp(const Vector3d& up) { return Eigen::Quaterniond::FromTwoVectors(up, Vector3d::UnitZ()); }

std::vector<Place> Rotated(const Eigen::Quaterniond& rotation, const Vector3d& middle, std::vector<Place> places) {
  for (Place& place : places) place.x = rotation * (place.x - middle);
  return places;
}

Vector3d MiddleOf(const std::vector<Place>& places) {
  Vector3d sum = Vector3d::Zero();
  for (const Place& place : places) sum += place.x;
  return sum / static_cast<double>(places.size());
}

double WorstSigma(const Eigen::Matrix2d& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()[1]));
}

/// Standard deviation of the slope in its worst direction: a jackknife over blocks of stands (Efron and Stein, The jackknife
/// estimate of variance, Annals of Statistics 9, 1981), and a difference between left and right. Infinite where a block alone
/// determines it.
double SlopeSigma(const Planes& planes, const std::vector<Place>& places, const std::vector<Place>& used, int blocks) {
  constexpr double kSidesM = 5e-3;
  Eigen::VectorXd sides = Eigen::VectorXd::Zero(planes.inverse.rows());
  for (const Place& place : used) sides += place.side * RowOf(place);
  const Eigen::Vector2d shift = kSidesM * (planes.inverse * sides).head<2>();
  Eigen::Matrix2d covariance = shift * shift.transpose();
  for (int block = 0; block < blocks; ++block) {
    std::vector<Place> others, used_of_others;
    for (const Place& place : places) {
      if (place.block != block) others.push_back(place);
    }
    const Planes without = FitPlanes(others, &used_of_others);
    if (!without.ok) return std::numeric_limits<double>::infinity();
    const Eigen::Vector2d change = without.slope - planes.slope;
    covariance += (blocks - 1.0) / blocks * change * change.transpose();
  }
  return WorstSigma(covariance);
}

/// The frame of the floor: z is `up`, z = 0 lies `height` above the old origin.
geometry::Rigid3 FloorFrame(const Vector3d& up, double height) {
  constexpr double kUpright = 0.9;
  const Vector3d forward = std::abs(up.x()) < kUpright ? Vector3d::UnitX() : Vector3d::UnitZ();
  const Vector3d x = (forward - up.dot(forward) * up).normalized(), y = up.cross(x);
  Eigen::Matrix3d rotation;
  rotation << x.transpose(), y.transpose(), up.transpose();
  geometry::Rigid3 floor_from_world;
  floor_from_world.rotation = Eigen::Quaterniond(rotation).normalized();
  floor_from_world.translation = Vector3d(0, 0, -height);
  return floor_from_world;
}

/// Height of the floor below the planes of the joints, and what says so.
double FloorLevel(const std::array<double, kKinds>& levels, const std::array<int, kKinds>& counts, double leg_m,
                  std::string* says) {
  double lowest = std::numeric_limits<double>::infinity();
  for (size_t k = 1; k < kKinds; ++k) {
    if (counts[k] > 0 && levels[k] < lowest)
      lowest = levels[k], *says = std::string("the lowest plane, that of ") + kFootJoints[k];
  }
  if (std::isfinite(lowest)) return lowest;
  constexpr double kLegOfStature = 0.491, kAnkleOfStature = 0.039;
  const double stature_m = leg_m / kLegOfStature;
  *says = Format("%.0f mm below the ankles, for a stature of %.2f m", 1e3 * kAnkleOfStature * stature_m, stature_m);
  return levels[0] - kAnkleOfStature * stature_m;
}

FeetFloor Undetermined(FeetFloor floor, Status status, const std::string& message) {
  floor.status = status, floor.message = message;
  return floor;
}

/// From planes without slope whose levels count from `middle`.
void FillLevels(const Planes& planes, const std::vector<Place>& used, double leg_m, const Vector3d& up, const Vector3d& middle,
                FeetFloor* floor) {
  std::array<int, kKinds> counts{};
  for (const Place& place : used) ++counts[place.kind];
  const double level = FloorLevel(planes.level, counts, leg_m, &floor->level);
  for (size_t k = 0; k < kKinds; ++k) {
    if (counts[k] > 0) floor->joint_height_m[kFootJoints[k]] = planes.level[k] - level;
  }
  floor->floor_from_world = FloorFrame(up, level + up.dot(middle));
}

}  // namespace

FeetFloor FloorUnderFeet(const dataset::Pose3d& pose) {
  constexpr int kFewestPlaces = 6, kTurns = 3;
  constexpr double kMostTiltDeg = 2.5;
  const Tracks tracks = TracksOf(pose);
  std::vector<Place> places = PlacesOf(tracks);
  const int blocks = MakeBlocks(&places);
  const std::string walk = ": people who walk about, in more than one direction, determine it";
  FeetFloor floor;
  floor.num_places = static_cast<int>(places.size());
  const Vector3d legs_up = LegsUp(tracks);
  Vector3d up = legs_up;
  if (up.norm() == 0)
    return Undetermined(floor, Status::kTooFewViews, "no person has hips and ankles, so nothing says what is up");
  if (floor.num_places < kFewestPlaces) {
    return Undetermined(floor, Status::kTooFewViews,
                        Format("feet stand in %d places; at least %d are needed", floor.num_places, kFewestPlaces) + walk);
  }
  const Vector3d middle = MiddleOf(places);
  std::vector<Place> used;
  Planes planes;
  std::vector<Place> rotated;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Eigen::Quaterniond to_up = ToUp(up);
    rotated = Rotated(to_up, middle, places);
    planes = FitPlanes(rotated, &used);
    if (!planes.ok) return Undetermined(floor, Status::kDegenerate, "the places of the feet do not determine a plane" + walk);
    up = (to_up.conjugate() * Vector3d(-planes.slope.x(), -planes.slope.y(), 1)).normalized();
  }
  constexpr double kMostLeanDeg = 30;
  if (!(up.dot(legs_up) > std::cos(DegToRad(kMostLeanDeg))))
    return Undetermined(floor, Status::kDegenerate, "the plane of the feet is no floor to the people's legs" + walk);
  std::vector<double> heights;
  for (const Place& place : used) heights.push_back(Above(planes, place));
  floor.num_used = static_cast<int>(used.size()), floor.rms_m = Rms(heights);
  floor.tilt_sigma_rad = SlopeSigma(planes, rotated, used, blocks);
  floor.rotated_rad = std::atan2(up.head<2>().norm(), up.z());
  constexpr double kLeastShare = 0.3;
  if (floor.num_used < kLeastShare * floor.num_places) {
    return Undetermined(
        floor, Status::kDegenerate,
        Format("of %d places where feet stand, %d lie on one plane: the floor has steps, or the joints are poor",
               floor.num_places, floor.num_used));
  }
  if (floor.num_used < kFewestPlaces || !(RadToDeg(floor.tilt_sigma_rad) <= kMostTiltDeg)) {
    return Undetermined(floor, Status::kDegenerate,
                        Format("the feet stand in %d places that leave the floor's tilt uncertain by %.1f degrees",
                               floor.num_used, RadToDeg(floor.tilt_sigma_rad)) +
                            walk);
  }
  FillLevels(planes, used, LegLength(tracks), up, middle, &floor);
  if (!floor.floor_from_world.translation.allFinite())
    return Undetermined(floor, Status::kTooFewViews,
                        "neither heels, toes nor knees are seen, so the ankles' height is unknown");
  return floor;
}

}  // namespace mvstudio::stages
