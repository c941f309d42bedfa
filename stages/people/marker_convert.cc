#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/markers/bvh.h"
#include "dataset/markers/marker_files.h"
#include "dataset/pose/markers.h"
#include "stages/people/marker_export.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using markers::MarkerTake;

/// What a format has by custom, and may have else.
struct Format3d {
  const char *word, *extension, *unit, *units, *up, *ups;
};
constexpr Format3d kFormats[] = {{"trc", ".trc", "mm", "mm m", "y", "x y z"},
                                 {"c3d", ".c3d", "mm", "mm", "z", "x y z"},
                                 {"bvh", ".bvh", "cm", "cm", "y", "y"},
                                 {"csv", ".csv", "m", "m", "z", "x y z"},
                                 {"wide", ".csv", "m", "m cm mm in", "z", "x y z"},
                                 {"npz", ".npz", "m", "m cm mm in", "z", "x y z"},
                                 {"sto", ".sto", "m", "m cm mm in", "y", "x y z"},
                                 {"pose3d", "", "m", "m", "z", "z"}};

const Format3d& FormatNamed(const std::string& word) {
  for (const Format3d& format : kFormats) {
    if (word == format.word) return format;
  }
  throw UsageError("option 'to' " + word + ": must be one of trc, c3d, bvh, csv, wide, npz, sto, pose3d" +
                   (word.find(',') == std::string::npos ? "" : "; `mvstudio markers` writes several at once"));
}

std::string Chosen(const std::string& asked, const char* custom, const char* possible, const char* option,
                   const Format3d& format) {
  if (asked.empty()) return custom;
  if ((" " + std::string(possible) + " ").find(" " + asked + " ") == std::string::npos)
    throw UsageError(std::string("option '") + option + "' " + asked + ": a ." + format.word + " is written with " + possible);
  return asked;
}

/// A skeleton with bones that has all the markers: that of the points, else the smallest one that is known.
geometry::Skeleton BonesFor(const dataset::Pose3d& pose, const MarkerTake& take) {
  const geometry::Skeleton own = SkeletonOf(pose);
  if (!own.bones.empty()) return own;
  const geometry::Skeleton* best = nullptr;
  for (const std::string& name : geometry::SkeletonNames()) {
    const geometry::Skeleton* known = geometry::FindSkeleton(name);
    if (known && HasJoints(*known, take.names) && (!best || known->joints.size() < best->joints.size())) best = known;
  }
  if (best) return *best;
  throw UsageError(
      "option 'to' bvh needs bones, and no known skeleton has all of these markers: name theirs by option 'skeleton'");
}

/// Positions such that a writer for `native` axes puts `up` up.
MarkerTake Rotated(MarkerTake take, const std::string& up, const std::string& native) {
  if (up == native) return take;
  for (Eigen::Vector3d& x : take.x_in_world) x = dataset::WorldFromAxes(dataset::AxesFromWorld(x, up), native);
  return take;
}

std::string BvhOf(const dataset::Pose3d& pose, const MarkerTake& take, std::optional<BvhFit>* fit) {
  const markers::MarkerBody hung = markers::HungFromPelvis(take, BonesFor(pose, take));
  const markers::BvhMotion motion = FitBvh(hung.take, hung.skeleton);
  *fit = {hung.skeleton.joints.size(), motion.rms_m, motion.max_m, motion.num_held};
  return BvhText(motion, hung.skeleton, take.rate_hz);
}

std::string Contents(const dataset::Pose3d& pose, const MarkerTake& take, const Format3d& format,
                     const markers::FileSpace& space, const std::string& name, std::optional<BvhFit>* bvh) {
  const std::string word = format.word;
  if (word == "trc") {
    const auto unit = space.unit == "m" ? markers::TrcUnit::kMetre : markers::TrcUnit::kMillimetre;
    return TrcText(Rotated(take, space.up, "y"), name, unit);
  }
  if (word == "c3d") return C3dBytes(take, space.up);
  if (word == "csv") return CsvText(Rotated(take, space.up, "z"));
  if (word == "wide") return WideCsvText(take, space);
  if (word == "npz") return NpzBytes(take, space);
  if (word == "sto") return StoText(take, space);
  return BvhOf(pose, take, bvh);
}

/// What is in the take and has no place in the format.
std::vector<std::string> Lost(const MarkerTake& take, const std::string& to) {
  std::vector<std::string> lost;
  const bool sigmas = std::any_of(take.sigma_m.begin(), take.sigma_m.end(), [](double sigma) { return sigma > 0; });
  const auto has = [&](markers::Source source) { return std::count(take.source.begin(), take.source.end(), source) > 0; };
  const bool any_missing = has(markers::Source::kMissing), filled = has(markers::Source::kFilled);
  if (sigmas && to != "csv" && to != "npz" && to != "c3d") lost.push_back("deviations of the positions");
  if (filled && (to == "trc" || to == "wide" || to == "sto" || to == "bvh")) lost.push_back("which positions were filled");
  if (to == "c3d") lost.push_back("digits beyond single precision");
  if (to == "bvh" && any_missing) lost.push_back("that positions are missing: rotations are held there");
  if (to == "bvh") lost.push_back("bones that change their lengths; how bones turn about themselves");
  if (to == "bvh" && take.first_frame != 0) lost.push_back("the numbers of the frames: they begin with 0");
  return lost;
}

/// `input`: where the points come from.
std::vector<MarkerTake> ChosenPersons(const dataset::Pose3d& pose, const std::string& input, int person, bool one_file) {
  std::vector<MarkerTake> takes = markers::MarkersOf(pose, pose.frame_rate_hz);
  std::vector<std::string> ids;
  for (const MarkerTake& take : takes) ids.push_back(std::to_string(take.person));
  if (takes.empty()) throw FormatError(input, "", "no point of anybody has a position");
  if (person >= 0) {
    takes.erase(std::remove_if(takes.begin(), takes.end(), [&](const MarkerTake& take) { return take.person != person; }),
                takes.end());
    if (takes.empty()) throw UsageError(Format("option 'person' %d: there are persons %s", person, Join(ids, ", ").c_str()));
  }
  if (one_file && takes.size() > 1) {
    throw UsageError("the points are of persons " + Join(ids, ", ") +
                     ", a file holds one: name it by option 'person', or give a folder as output");
  }
  return takes;
}

}  // namespace

std::string ConvertFormat(const ConvertOptions& options, const std::string& out) {
  if (!options.to.empty()) return FormatNamed(options.to).word;
  std::string extension = std::filesystem::path(out).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const Format3d& format : kFormats) {
    if (!extension.empty() && extension == format.extension) return format.word;
  }
  throw UsageError("option 'to' is needed where the output's name does not end in .trc, .c3d, .bvh, .csv, .npz or .sto");
}

bool IsFileOfFormat(const ConvertOptions& options, const std::string& out) {
  const Format3d& format = FormatNamed(ConvertFormat(options, out));
  std::string extension = std::filesystem::path(out).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return std::tolower(c); });
  return format.extension[0] && extension == format.extension;
}

ConvertReport ConvertMarkers(const dataset::Pose3d& pose, const std::string& input, const ConvertOptions& options,
                             const std::string& out, const std::string& work_folder) {
  namespace fs = std::filesystem;
  const Format3d& format = FormatNamed(ConvertFormat(options, out));
  const markers::FileSpace space{Chosen(options.unit, format.unit, format.units, "to-unit", format),
                                 Chosen(options.up, format.up, format.ups, "to-up", format)};
  const bool file = IsFileOfFormat(options, out);
  ConvertReport report{format.word, space.unit, space.up, {}, {}};
  for (const MarkerTake& take : ChosenPersons(pose, input, options.person, file)) {
    ConvertReport::Person& person = report.persons.emplace_back();
    person.person = take.person, person.num_frames = take.num_frames(), person.num_markers = take.num_markers();
    person.not_held = Lost(take, format.word);
    if (!format.extension[0]) continue;
    const std::string name =
        file ? fs::path(out).filename().string() : "person" + std::to_string(take.person) + format.extension;
    WriteFileAtomic(file ? out : (fs::path(work_folder) / name).string(),
                    Contents(pose, take, format, space, name, &person.bvh));
    report.files.push_back({file ? out : (fs::path(out) / name).string(), "markers"});
  }
  if (format.extension[0]) return report;
  dataset::Pose3d kept = pose;
  if (options.person >= 0) {
    kept.rows.erase(
        std::remove_if(kept.rows.begin(), kept.rows.end(), [&](const auto& row) { return row.person != options.person; }),
        kept.rows.end());
  }
  WritePose3d(kept, work_folder);
  for (const char* name : {"points.csv", "covariance.csv", "pose3d.json"})
    report.files.push_back({(fs::path(out) / name).string(), ""});
  return report;
}

}  // namespace mvstudio::stages
