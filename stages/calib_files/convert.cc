#include <algorithm>
#include <filesystem>
#include <memory>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/exports/export.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/calib_files/run.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using calib::CalibrationFormat;
using geometry::Rig;
using geometry::RigCamera;

void RenameCameras(const std::vector<std::string>& pairs, Rig* rig) {
  for (const std::string& pair : pairs) {
    const auto [old_name, new_name] = SplitNamePath("option 'rename'", pair);
    const int found = rig->Find(old_name);
    if (found < 0) throw UsageError("option 'rename' " + pair + ": there is no camera '" + old_name + "'");
    if (rig->Find(new_name) >= 0)
      throw UsageError("option 'rename' " + pair + ": there is a camera '" + new_name + "' already");
    rig->cameras[found].camera.name = new_name;
  }
}

bool IsPanopticName(const std::string& name) {
  const auto digit = [&](size_t i) { return name[i] >= '0' && name[i] <= '9'; };
  return name.size() == 5 && digit(0) && digit(1) && name[2] == '_' && digit(3) && digit(4);
}

/// Panoptic's files know only names like 00_07: numbers the cameras in their order.
void RenameForPanoptic(CalibConvertReport* report) {
  std::vector<RigCamera>& cameras = report->rig.cameras;
  report->renumbered =
      !std::all_of(cameras.begin(), cameras.end(), [](const RigCamera& camera) { return IsPanopticName(camera.camera.name); });
  if (!report->renumbered) return;
  if (cameras.size() > 100)
    throw UsageError("Panoptic's file names hold at most 100 cameras of one panel, here are " + std::to_string(cameras.size()));
  for (size_t i = 0; i < cameras.size(); ++i) {
    const std::string name = Format("00_%02d", static_cast<int>(i));
    report->renamed.emplace_back(cameras[i].camera.name, name);
    cameras[i].camera.name = name;
  }
}

/// Writes a dataset format's cameras; returns the files.
std::vector<std::string> WriteDatasetFormat(CalibConvertReport* report) {
  const CalibConvertOptions& options = report->options;
  if (options.out_unit != calib::LengthUnit::kMetre)
    throw UsageError("option 'out-unit': " + options.to + " has a unit of its own");
  const bool one_file = exports::IsRigFile(exports::FormatByName(options.to), options.out);
  const exports::ExportReport written = exports::WriteRig(report->rig, options.to, options.out);
  std::vector<std::string> files;
  for (const std::string& file : written.files) files.push_back(one_file ? options.out : options.out + "/" + file);
  Append(written.notes, &report->notes.warnings);
  for (const exports::ExportedCamera& camera : written.cameras) {
    if (camera.name != camera.source) report->renamed.emplace_back(camera.source, camera.name);
  }
  return files;
}

/// Writes the rig; returns the files.
std::vector<std::string> WriteCalibrationFormat(CalibrationFormat format, CalibConvertReport* report) {
  const CalibConvertOptions& given = report->options;
  calib::WriteOptions options;
  options.metres_per_unit = MetresPer(given.out_unit);
  options.allow_approximation_px = given.read.allow_approximation_px;
  options.qca_distortion_divisor = given.read.qca_distortion_divisor;
  if (format != CalibrationFormat::kPanoptic) {
    const calib::ExportReport written = calib::WriteCalibration(report->rig, format, given.out, options);
    AddNotes(written.notes, &report->notes);
    return written.files;
  }
  std::vector<Notice> notes;
  report->rig = calib::RigForFormat(report->rig, format, options, given.out, &notes);
  AddNotes(notes, &report->notes);
  RenameForPanoptic(report);
  dataset::WritePanopticCalibration(report->rig, given.out, std::filesystem::path(given.in.front()).filename().string());
  return {given.out};
}

/// Whether `out` is the name of a file of this format, and not of a folder for its files.
bool IsCalibFile(const CalibConvertOptions& options, CalibrationFormat format) {
  if (std::filesystem::is_directory(options.out) || HasFolderForm(options.out)) return false;
  if (calib::IsDatasetLayout(format)) return exports::IsRigFile(exports::FormatByName(options.to), options.out);
  const std::string ending = std::filesystem::path(options.out).extension().string();
  switch (format) {
    case CalibrationFormat::kColmap:
    case CalibrationFormat::kColmapText:
    case CalibrationFormat::kEasyMocap:
      return false;
    case CalibrationFormat::kOpenCvYaml:
      return ending == ".yml" || ending == ".yaml";
    case CalibrationFormat::kMrcal:
      return ending == ".cameramodel";
    case CalibrationFormat::kNerfstudio:
      return ending == ".json";
    default:
      return true;
  }
}

}  // namespace

std::vector<std::string> CalibOutputNames() {
  std::vector<std::string> names;
  for (const CalibrationFormat format : calib::kAllCalibrationFormats) names.emplace_back(ToString(format));
  for (const exports::FormatInfo& format : exports::Formats()) {
    if (format.rig_only) names.push_back(format.name);
  }
  return names;
}

CalibConvertReport RunCalibConvert(const CalibConvertOptions& given) {
  CalibConvertReport report;
  report.options = given;
  CalibConvertOptions& options = report.options;
  calib::ImportedRig imported = ReadCalibrationFiles(options.in, options.read);
  report.notes.inputs = options.in;
  AddNotes(imported.notes, &report.notes);
  report.rig = std::move(imported.rig);
  RenameCameras(options.rename, &report.rig);
  // Layouts of datasets that cannot be read back have no name among the formats, and are written like those that can.
  const CalibrationFormat format = calib::CalibrationFormatFromString(options.to).value_or(CalibrationFormat::kNpz);
  const bool is_layout = calib::IsDatasetLayout(format);
  report.format = is_layout ? options.to : std::string(ToString(format));
  const bool file = IsCalibFile(options, format);
  if (!file) options.out = OutputName(options.out, OutputKind::kFolder);
  const auto in_folder = file ? nullptr : std::make_unique<OutputFolder>(options.out, options.in, std::vector<std::string>());
  const auto as_file = file ? std::make_unique<OutputFiles>(std::vector<std::string>{options.out}, options.in) : nullptr;
  FilesTogether together;
  report.files = is_layout ? WriteDatasetFormat(&report) : WriteCalibrationFormat(format, &report);
  together.Commit();
  report.folder = file ? std::filesystem::path(PathOnDisk(options.out)).parent_path().string() : options.out;
  return report;
}

}  // namespace mvstudio::stages
