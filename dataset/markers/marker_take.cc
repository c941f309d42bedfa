#include "dataset/markers/marker_take.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/error.h"

namespace mvstudio::markers {
namespace {

constexpr int64_t kMostFrames = 1'000'000;
const double kNan = std::numeric_limits<double>::quiet_NaN();

struct Person {
  int first = 0, last = 0;
  std::vector<std::string> names;
  std::map<std::string, int> index;
};

std::map<int, Person> FindPersons(const dataset::Pose3d& pose) {
  std::map<int, Person> persons;
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status != Status::kOk || !row.x_in_world.allFinite()) continue;
    const auto [it, is_new] = persons.try_emplace(row.person);
    Person& person = it->second;
    if (is_new) person.first = person.last = row.frame;
    person.first = std::min(person.first, row.frame), person.last = std::max(person.last, row.frame);
    person.index.emplace(row.joint, 0);
  }
  for (const dataset::JointRow& row : pose.rows) {  // in the order of the table, missing or not
    const auto it = persons.find(row.person);
    if (it == persons.end()) continue;
    const auto known = it->second.index.find(row.joint);
    auto& names = it->second.names;
    if (known == it->second.index.end() || std::find(names.begin(), names.end(), row.joint) != names.end()) continue;
    known->second = static_cast<int>(names.size());
    names.push_back(row.joint);
  }
  return persons;
}

MarkerTake EmptyTake(int id, const Person& person, double rate_hz) {
  const int64_t span = int64_t{person.last} - person.first + 1;
  if (span > kMostFrames) {
    throw UsageError("frames " + std::to_string(person.first) + " to " + std::to_string(person.last) + " of person " +
                     std::to_string(id) + ": marker files have one line a time step, which would be " + std::to_string(span));
  }
  MarkerTake take;
  take.person = id, take.rate_hz = rate_hz, take.first_frame = person.first, take.names = person.names;
  const size_t count = static_cast<size_t>(span) * person.names.size();
  take.x_in_world.assign(count, Eigen::Vector3d::Constant(kNan));
  take.sigma_m.assign(count, 0);
  take.source.assign(count, Source::kMissing);
  return take;
}

}  // namespace

std::vector<MarkerTake> MarkersOf(const dataset::Pose3d& pose, double rate_hz) {
  if (!(rate_hz > 0) || !std::isfinite(rate_hz)) throw UsageError("the frame rate must be positive");
  const std::map<int, Person> persons = FindPersons(pose);
  std::map<int, MarkerTake> takes;
  for (const auto& [id, person] : persons) takes.emplace(id, EmptyTake(id, person, rate_hz));
  for (const dataset::JointRow& row : pose.rows) {
    if (row.status != Status::kOk || !row.x_in_world.allFinite()) continue;
    MarkerTake& take = takes.at(row.person);
    const size_t i = take.Index(row.frame - take.first_frame, persons.at(row.person).index.at(row.joint));
    take.x_in_world[i] = row.x_in_world;
    take.sigma_m[i] = std::isfinite(row.sigma_m) ? row.sigma_m : 0;
    take.source[i] = row.num_views > 0 ? Source::kMeasured : Source::kFilled;
  }
  std::vector<MarkerTake> list;
  for (auto& [id, take] : takes) list.push_back(std::move(take));
  return list;
}

std::vector<MarkerMotion> MeasureMotion(const MarkerTake& take) {
  std::vector<MarkerMotion> motions;
  for (int m = 0; m < take.num_markers(); ++m) {
    MarkerMotion motion;
    motion.name = take.names[static_cast<size_t>(m)];
    double sum = 0;
    int count = 0, last = -1;
    for (int f = 0; f < take.num_frames(); ++f) {
      const size_t i = take.Index(f, m);
      if (take.source[i] != Source::kMissing && last < 0) motion.missing_at_start = f;
      if (take.source[i] != Source::kMissing) last = f;
      motion.measured += take.source[i] == Source::kMeasured;
      motion.filled += take.source[i] == Source::kFilled;
      motion.missing += take.source[i] == Source::kMissing;
      if (f < 2) continue;
      const Eigen::Vector3d second =
          take.x_in_world[i] - 2 * take.x_in_world[take.Index(f - 1, m)] + take.x_in_world[take.Index(f - 2, m)];
      if (!second.allFinite()) continue;
      sum += second.squaredNorm(), ++count;
    }
    motion.missing_at_end = take.num_frames() - 1 - last;
    motion.acceleration_m_s2 = count > 0 ? std::sqrt(sum / count) * take.rate_hz * take.rate_hz : kNan;
    motions.push_back(motion);
  }
  return motions;
}

double MeanAcceleration(const std::vector<MarkerMotion>& motions) {
  double sum = 0;
  int count = 0;
  for (const MarkerMotion& motion : motions) {
    if (!std::isfinite(motion.acceleration_m_s2)) continue;
    sum += motion.acceleration_m_s2 * motion.acceleration_m_s2, ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : kNan;
}

namespace {

/// Of all moves the farthest, one for each marker and half second.
std::vector<Displacement::Move> Largest(std::vector<Displacement::Move> moves, double rate_hz) {
  constexpr size_t kShown = 10;
  std::sort(moves.begin(), moves.end(), [](const auto& a, const auto& b) { return a.distance_m > b.distance_m; });
  std::vector<Displacement::Move> largest;
  for (const Displacement::Move& move : moves) {
    if (largest.size() >= kShown) break;
    const bool near = std::any_of(largest.begin(), largest.end(), [&](const Displacement::Move& known) {
      return known.marker == move.marker && std::abs(known.frame_idx - move.frame_idx) < 0.5 * rate_hz;
    });
    if (!near && move.distance_m > 0) largest.push_back(move);
  }
  return largest;
}

}  // namespace

Displacement MeasureDisplacement(const MarkerTake& before, const MarkerTake& after) {
  Displacement displacement;
  double sum = 0, sigmas = 0;
  int count = 0, with_sigma = 0;
  std::vector<Displacement::Move> moves;
  for (size_t i = 0; i < before.x_in_world.size() && i < after.x_in_world.size(); ++i) {
    const double distance = (after.x_in_world[i] - before.x_in_world[i]).norm();
    if (!std::isfinite(distance)) continue;
    sum += distance * distance, ++count;
    const double sigma = std::sqrt(3.0) * before.sigma_m[i];
    moves.push_back({static_cast<int>(i % before.names.size()), static_cast<int>(i / before.names.size()), distance,
                     sigma > 0 ? distance / sigma : kNan});
    if (!(sigma > 0)) continue;
    sigmas += distance * distance / (sigma * sigma), ++with_sigma;
  }
  displacement.largest = Largest(std::move(moves), before.rate_hz);
  displacement.max_m = displacement.largest.empty() ? 0 : displacement.largest.front().distance_m;
  displacement.rms_m = count > 0 ? std::sqrt(sum / count) : 0;
  displacement.rms_sigmas = with_sigma > 0 ? std::sqrt(sigmas / with_sigma) : kNan;
  return displacement;
}

}  // namespace mvstudio::markers
