#include "triangulate/skeleton/refine.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/statistics.h"
#include "triangulate/skeleton/choice.h"
#include "triangulate/skeleton/window.h"

namespace mvstudio::triangulate {

namespace internal {

Window Part(const Window& window, size_t first, size_t last) {
  Window part{window.person, {}, window.num_joints, {}};
  part.frames.assign(window.frames.begin() + static_cast<std::ptrdiff_t>(first),
                     window.frames.begin() + static_cast<std::ptrdiff_t>(last));
  if (!window.clips.empty()) {
    part.clips.assign(window.clips.begin() + static_cast<std::ptrdiff_t>(first),
                      window.clips.begin() + static_cast<std::ptrdiff_t>(last));
  }
  part.cells.assign(window.cells.begin() + static_cast<std::ptrdiff_t>(first * window.num_joints),
                    window.cells.begin() + static_cast<std::ptrdiff_t>(last * window.num_joints));
  return part;
}

std::vector<double> BoneLengths(const std::vector<Point>& points, size_t num_joints, const std::pair<int, int>& bone) {
  std::vector<double> lengths;
  for (size_t first = 0; first + num_joints <= points.size(); first += num_joints) {
    const Point &a = points[first + static_cast<size_t>(bone.first)], &b = points[first + static_cast<size_t>(bone.second)];
    if (a.status == Status::kOk && b.status == Status::kOk) lengths.push_back((a.x_in_world - b.x_in_world).norm());
  }
  return lengths;
}

std::vector<Point> PointsOf(const Window& window) {
  std::vector<Point> points;
  for (const Cell& cell : window.cells) points.push_back(cell.point);
  return points;
}

std::vector<KnownLength> MeasureLengths(const Window& window, const Bones& bones) {
  const std::vector<Point> points = PointsOf(window);
  std::vector<KnownLength> known;
  for (const auto& bone : bones) {
    const std::vector<double> lengths = BoneLengths(points, window.num_joints, bone);
    known.emplace_back();
    if (static_cast<int>(lengths.size()) < internal::kMinLengthFrames) continue;
    const double median = UpperMedian(lengths);
    std::vector<double> deviations;
    for (const double length : lengths) deviations.push_back(std::abs(length - median));
    if (median > 1e-6) known.back() = {median, std::max(kSigmaPerMad * UpperMedian(std::move(deviations)), 0.01 * median)};
  }
  return known;
}

}  // namespace internal

namespace {

using internal::BoneLengths;
using internal::Bones;
using internal::Cell;
using internal::KnownLength;
using internal::MeasureLengths;
using internal::Part;
using internal::PointsOf;
using internal::Terms;
using internal::Window;
using internal::WindowSolution;

constexpr size_t kMaxWindowFrames = 600;

void CheckOptions(const SkeletonRefineOptions& o) {
  const auto require = [](bool holds, const char* message) {
    if (!holds) throw UsageError(message);
  };
  require(o.max_fill_frames >= 0 && o.max_fill_frames <= 1000, "option 'refine-max-fill-frames' must lie in 0..1000");
  require(o.max_fill_sigmas > 0, "option 'refine-max-fill-sigmas' must be positive");
  require(o.choice_frames >= 10, "option 'refine-choice-frames' must be at least 10");
  require(o.choice_cameras >= 1, "option 'refine-choice-cameras' must be at least 1");
}

size_t NumJoints(const TakeResult& take) {
  int joints = 0;
  for (const TakePoint& entry : take.points) joints = std::max(joints, entry.joint_idx + 1);
  return static_cast<size_t>(joints);
}

/// Whether another clip begins at frame `f` of the window: the joints known in it and in the frame before are displaced by
/// more than anybody moves (median).
bool IsCut(const Window& window, size_t f) {
  constexpr double kStepM = 0.5, kStepPerFrameM = 0.1;  // 3 m/s at 30 Hz
  std::vector<double> steps;
  for (size_t j = 0; j < window.num_joints; ++j) {
    const Point &before = window.At(f - 1, j).point, &point = window.At(f, j).point;
    if (before.status == Status::kOk && point.status == Status::kOk)
      steps.push_back((point.x_in_world - before.x_in_world).norm());
  }
  return UpperMedian(std::move(steps), 0) > kStepM + kStepPerFrameM * (window.frames[f] - window.frames[f - 1]);
}

/// The whole take, one window a person.
std::vector<Window> MakePersons(const TakeResult& take, size_t num_joints) {
  std::map<int, std::map<int, std::vector<size_t>>> entries;  // person, frame
  for (size_t i = 0; i < take.points.size(); ++i) entries[take.points[i].person][take.points[i].frame].push_back(i);
  std::vector<Window> persons;
  for (const auto& [person, frames] : entries) {
    Window& window = persons.emplace_back();
    window.person = person;
    window.num_joints = num_joints;
    for (const auto& [frame, indices] : frames) {
      const size_t first = window.cells.size();
      window.frames.push_back(frame);
      window.cells.resize(first + num_joints, Cell{take.points.size(), {}, {}});
      for (const size_t i : indices) {
        window.cells[first + static_cast<size_t>(take.points[i].joint_idx)] = {i, take.points[i].point, take.observations[i]};
      }
      const size_t f = window.clips.size();
      window.clips.push_back(f == 0 ? 0 : window.clips.back() + (IsCut(window, f) ? 1 : 0));
    }
  }
  return persons;
}

/// Median |second divided difference| of each joint over the take, m / frame^2; 0 for joints never seen three times in a row.
std::vector<double> TypicalAccelerations(const std::vector<Window>& persons, size_t num_joints) {
  constexpr int kMaxSpan = 4;
  std::vector<double> typical(num_joints, 0);
  for (size_t j = 0; j < num_joints; ++j) {
    std::vector<double> sizes;
    for (const Window& window : persons) {
      for (size_t f = 2; f < window.frames.size(); ++f) {
        const Point &p0 = window.At(f - 2, j).point, &p1 = window.At(f - 1, j).point, &p2 = window.At(f, j).point;
        const double t0 = window.frames[f - 2], t1 = window.frames[f - 1], t2 = window.frames[f];
        if (p0.status != Status::kOk || p1.status != Status::kOk || p2.status != Status::kOk) continue;
        if (window.FramesApart(f - 2, f) > kMaxSpan) continue;
        const Eigen::Vector3d after = (p2.x_in_world - p1.x_in_world) / (t2 - t1);
        const Eigen::Vector3d before = (p1.x_in_world - p0.x_in_world) / (t1 - t0);
        sizes.push_back((after - before).norm() * 2 / (t2 - t0));
      }
    }
    if (!sizes.empty()) typical[j] = std::max(UpperMedian(std::move(sizes)), 1e-9);
  }
  return typical;
}

/// A stretch of a person's frames [first, last), solved with its surroundings [begin, end).
struct Stretch {
  size_t person, begin, first, last, end;
};

std::vector<Stretch> Stretches(const std::vector<Window>& persons, bool only_cut) {
  constexpr size_t kOverlap = 20;
  std::vector<Stretch> stretches;
  for (size_t p = 0; p < persons.size(); ++p) {
    const size_t count = persons[p].frames.size();
    if (only_cut && count <= kMaxWindowFrames) continue;
    for (size_t first = 0; first < count; first += kMaxWindowFrames) {
      const size_t last = std::min(first + kMaxWindowFrames, count);
      const bool whole = count <= kMaxWindowFrames;
      stretches.push_back({p, first - std::min(first, whole ? 0 : kOverlap), first, last, std::min(last + kOverlap, count)});
    }
  }
  return stretches;
}

/// Puts the points of a stretch side by side with those of the others. The stretch keeps none: long takes have many.
void PutPoints(const Stretch& s, size_t joints, WindowSolution* part, WindowSolution* whole) {
  std::move(part->points.begin() + static_cast<std::ptrdiff_t>((s.first - s.begin) * joints),
            part->points.begin() + static_cast<std::ptrdiff_t>((s.last - s.begin) * joints),
            whole->points.begin() + static_cast<std::ptrdiff_t>(s.first * joints));
  part->points = {};
}

/// Of each bone the median length, sigma 0 where none was estimated.
void MergeLengths(const std::vector<Stretch>& stretches, const std::vector<WindowSolution>& parts,
                  std::vector<WindowSolution>* wholes, int* num_unrefined) {
  std::map<size_t, std::vector<std::vector<KnownLength>>> lengths;  // person, bone
  for (size_t k = 0; k < stretches.size(); ++k) {
    const Stretch& s = stretches[k];
    if (!parts[k].solved) *num_unrefined += static_cast<int>(s.last - s.first);
    auto& of_person = lengths[s.person];
    of_person.resize(parts[k].lengths.size());
    for (size_t b = 0; b < of_person.size(); ++b) {
      if (parts[k].lengths[b].sigma_m > 0) of_person[b].push_back(parts[k].lengths[b]);
    }
  }
  for (const auto& [person, bones] : lengths) {
    (*wholes)[person].lengths.assign(bones.size(), {});
    for (size_t b = 0; b < bones.size(); ++b) {
      std::vector<double> values, sigmas;
      for (const KnownLength& each : bones[b]) values.push_back(each.length_m), sigmas.push_back(each.sigma_m);
      if (values.empty()) continue;
      const double root = std::sqrt(static_cast<double>(values.size()));
      (*wholes)[person].lengths[b] = {UpperMedian(std::move(values)), UpperMedian(std::move(sigmas)) / root};
    }
  }
}

/// All persons, in stretches; where a take is longer than one, again with one length a bone for all of them.
std::vector<WindowSolution> SolvePersons(const PreparedRig& rig, const std::vector<Window>& persons, const Bones& bones,
                                         const Terms& terms, const RunContext& run, int* num_unrefined) {
  constexpr int kIterations = 20, kMostAtOnce = 8;  // each in work takes 60 MB for 25 joints
  std::vector<WindowSolution> wholes;
  std::vector<std::vector<KnownLength>> known;
  for (const Window& person : persons) {
    known.push_back(MeasureLengths(person, bones));
    wholes.push_back({PointsOf(person), std::vector<KnownLength>(bones.size())});
  }
  const std::vector<Stretch> all = Stretches(persons, false);
  const std::vector<Stretch> again = terms.bone_lengths > 0 ? Stretches(persons, true) : std::vector<Stretch>{};
  ProgressStage stage(run, "refine joints", static_cast<int64_t>(all.size() + again.size()));
  for (const std::vector<Stretch>* stretches : {&all, &again}) {
    std::vector<WindowSolution> parts(stretches->size());
    const int threads = std::min(ResolveThreads(run.num_threads), kMostAtOnce);
    ParallelFor(static_cast<int64_t>(parts.size()), threads, [&](int64_t k) {
      const Stretch& s = (*stretches)[static_cast<size_t>(k)];
      const Window part = Part(persons[s.person], s.begin, s.end);
      WindowSolution& solved = parts[static_cast<size_t>(k)];
      solved = SolveWindow(rig, part, bones, known[s.person], terms, kIterations, run);
      PutPoints(s, part.num_joints, &solved, &wholes[s.person]);
      stage.Advance();
    });
    *num_unrefined = stretches == &all ? 0 : *num_unrefined;
    MergeLengths(*stretches, parts, &wholes, num_unrefined);
    for (const Stretch& s : again) {
      for (size_t b = 0; b < bones.size(); ++b) {
        if (wholes[s.person].lengths[b].sigma_m > 0) known[s.person][b] = wholes[s.person].lengths[b];
      }
    }
  }
  return wholes;
}

double StandardDeviation(const std::vector<double>& values) {
  double mean = 0, sum = 0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  for (const double value : values) sum += (value - mean) * (value - mean);
  return values.size() < 2 ? 0 : std::sqrt(sum / static_cast<double>(values.size() - 1));
}

void AddBoneReports(const Window& person, const WindowSolution& solution, const Bones& bones, const Terms& terms,
                    SkeletonRefineReport* report) {
  std::vector<Point> before = PointsOf(person), after = solution.points;
  for (size_t i = 0; i < before.size(); ++i) {  // the same frames in both
    if (before[i].status != Status::kOk) after[i].status = before[i].status;
  }
  for (size_t b = 0; b < bones.size(); ++b) {
    const auto in_before = BoneLengths(before, person.num_joints, bones[b]);
    const auto in_after = BoneLengths(after, person.num_joints, bones[b]);
    BoneReport bone{person.person, bones[b].first, bones[b].second, static_cast<int>(in_before.size()), 0, 0, 0, 0};
    if (in_before.empty()) continue;
    const bool estimated = terms.bone_lengths > 0 && b < solution.lengths.size() && solution.lengths[b].sigma_m > 0;
    bone.length_m = estimated ? solution.lengths[b].length_m : UpperMedian(in_before);
    bone.sigma_m = estimated ? solution.lengths[b].sigma_m : 0;
    bone.std_before_mm = 1000 * StandardDeviation(in_before);
    bone.std_after_mm = 1000 * StandardDeviation(in_after);
    report->bones.push_back(bone);
  }
}

void AverageBones(SkeletonRefineReport* report) {
  double before = 0, after = 0;
  int count = 0;
  for (const BoneReport& bone : report->bones) {
    if (bone.num_frames < internal::kMinLengthFrames) continue;
    before += bone.std_before_mm, after += bone.std_after_mm, ++count;
  }
  report->limb_std_before_mm = count > 0 ? before / count : std::nan("");
  report->limb_std_after_mm = count > 0 ? after / count : std::nan("");
}

}  // namespace

SkeletonRefineResult RefineSkeleton(const PreparedRig& rig, const TakeResult& take, const Bones& bones,
                                    const PointSolver& solve, const SkeletonRefineOptions& options, const RunContext& run) {
  CheckOptions(options);
  MVS_CHECK(take.points.size() == take.observations.size(), take.points.size() << " points, " << take.observations.size());
  const size_t num_joints = NumJoints(take);
  for (const auto& [a, b] : bones) {
    MVS_CHECK(a >= 0 && b >= 0 && a != b, "bone " << a << "-" << b);
  }
  SkeletonRefineResult result;
  Bones known_bones;
  for (const auto& bone : bones) {
    if (static_cast<size_t>(std::max(bone.first, bone.second)) < num_joints) known_bones.push_back(bone);
  }
  const std::vector<Window> persons = MakePersons(take, num_joints);
  Terms terms;
  terms.acceleration_m = TypicalAccelerations(persons, num_joints);
  terms.max_fill_frames = options.max_fill_frames, terms.max_fill_sigmas = options.max_fill_sigmas;
  terms = internal::ChooseTerms(rig, persons, known_bones, solve, options, terms, run, &result.report);

  const std::vector<WindowSolution> solutions =
      SolvePersons(rig, persons, known_bones, terms, run, &result.report.num_unrefined_frames);
  result.points = take.points;
  for (size_t p = 0; p < persons.size(); ++p) {
    for (size_t i = 0; i < persons[p].cells.size(); ++i) {
      const size_t at = persons[p].cells[i].take_idx;
      if (at == take.points.size()) continue;
      result.report.num_filled += take.points[at].point.status != Status::kOk && solutions[p].points[i].status == Status::kOk;
      result.points[at].point = solutions[p].points[i];
    }
    AddBoneReports(persons[p], solutions[p], known_bones, terms, &result.report);
  }
  AverageBones(&result.report);
  return result;
}

}  // namespace mvstudio::triangulate
