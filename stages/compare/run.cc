#include "stages/compare/run.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "core/disk/output.h"
#include "core/error.h"
#include "core/some_of.h"
#include "geometry/rig/rig_covariance.h"

namespace mvstudio::stages {
namespace {

using geometry::Rig;
using geometry::RigCamera;

/// Keeps the cameras of `rig` that `other` has too; returns the names of the rest.
std::vector<std::string> KeepCommon(const Rig& other, Rig* rig) {
  std::vector<std::string> missing;
  std::vector<size_t> kept;
  for (size_t c = 0; c < rig->cameras.size(); ++c) {
    const std::string& name = rig->cameras[c].camera.name;
    if (other.Find(name) >= 0)
      kept.push_back(c);
    else
      missing.push_back(name);
  }
  if (kept.size() < rig->cameras.size()) *rig = geometry::SubsetOf(*rig, kept);
  return missing;
}

std::vector<double> ParseMetres(const std::string& text) {
  std::vector<double> ranges;
  for (size_t start = 0; start <= text.size();) {
    const size_t end = std::min(text.find(',', start), text.size());
    double range = 0;
    const auto [stop, code] = std::from_chars(text.data() + start, text.data() + end, range);
    if (code != std::errc() || stop != text.data() + end || !(range > 0)) {
      throw UsageError("option 'range-m' " + text + ": expected distances in metres such as 1,3,inf");
    }
    ranges.push_back(range);
    start = end + 1;
  }
  return ranges;
}

std::vector<ComparedLenses> CompareLenses(const Rig& rig, const Rig& reference, const CompareOptions& given) {
  calib::ProjectionDiffOptions options;
  options.ranges_m = ParseMetres(given.ranges_m);
  options.implied = given.implied;
  options.focus = given.focus;
  options.grid_cols = given.grid;
  std::vector<ComparedLenses> lenses;
  for (const RigCamera& camera : reference.cameras) {
    const RigCamera& other = rig.cameras[static_cast<size_t>(rig.Find(camera.camera.name))];
    lenses.push_back({camera.camera.name, CompareProjection(other.camera, camera.camera, options),
                      ExpectedProjectionRms(other, camera, options)});
  }
  return lenses;
}

}  // namespace

CompareReport RunCompare(const CompareOptions& options) {
  CompareReport report;
  report.options = options;
  Rig rig, reference;
  for (const auto& [path, into] : {std::pair(&options.rig, &rig), std::pair(&options.reference, &reference)}) {
    calib::ImportedRig given = ReadCalibrationFiles({*path}, options.read);
    AddNotes(given.notes, &report.notes);
    report.notes.inputs.push_back(*path);
    *into = std::move(given.rig);
  }
  std::optional<OutputFolder> place;
  if (!options.out.empty())
    place.emplace(options.out, report.notes.inputs, std::vector<std::string>{"calib_compare.result.json"});
  if (rig.cameras.size() == 1 && reference.cameras.size() == 1) {
    rig.cameras[0].camera.name = reference.cameras[0].camera.name;  // whatever their names: nothing else can be meant
  }
  const std::vector<std::string> rig_names = geometry::CameraNames(rig), reference_names = geometry::CameraNames(reference);
  report.only_in_rig = KeepCommon(reference, &rig);
  report.only_in_reference = KeepCommon(rig, &reference);
  if (rig.cameras.empty()) {
    throw UsageError(options.rig + " and " + options.reference + ": no camera name is in both (" + SomeOf(rig_names) +
                     " beside " + SomeOf(reference_names) + "); give them one name: calib convert option 'rename' OLD=NEW");
  }
  report.cameras = geometry::CameraNames(reference);
  report.difference = geometry::CompareRigs(rig, reference);
  if (report.difference.status != Status::kOk) return report;
  if (!report.IsAlone()) {
    report.poses = calib::PoseDifferences(rig, reference, report.difference.reference_from_rig);
    report.expected_poses = calib::ExpectedPoseDifferences(rig, reference);
  }
  report.lenses = CompareLenses(rig, reference, options);
  return report;
}

}  // namespace mvstudio::stages
