#include <algorithm>
#include <filesystem>

#include "calib/formats/formats.h"
#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/disk/files.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/format.h"
#include "core/join.h"
#include "dataset/exports/export.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

using calib::CalibrationFormat;
using geometry::Rig;
using geometry::RigCamera;

struct Arguments {
  stages::CalibReadOptions read;
  std::vector<std::string> in, rename;
  std::string to = "mvstudio", out;
  calib::LengthUnit out_unit = calib::LengthUnit::kMetre;
};

void Rename(const std::vector<std::string>& pairs, Rig* rig) {
  for (const std::string& pair : pairs) {
    const auto [old_name, new_name] = SplitNamePath("--rename", pair);
    const int found = rig->Find(old_name);
    if (found < 0) throw UsageError("--rename " + pair + ": there is no camera '" + old_name + "'");
    if (rig->Find(new_name) >= 0) throw UsageError("--rename " + pair + ": there is a camera '" + new_name + "' already");
    rig->cameras[found].camera.name = new_name;
  }
}

bool IsPanopticName(const std::string& name) {
  const auto digit = [&](size_t i) { return name[i] >= '0' && name[i] <= '9'; };
  return name.size() == 5 && digit(0) && digit(1) && name[2] == '_' && digit(3) && digit(4);
}

/// Panoptic's files know only names like 00_07: numbers the cameras in their order and says which became which.
void RenameForPanoptic(Rig* rig, CommandResult* result) {
  const bool fits = std::all_of(rig->cameras.begin(), rig->cameras.end(),
                                [](const RigCamera& camera) { return IsPanopticName(camera.camera.name); });
  if (fits) return;
  if (rig->cameras.size() > 100)
    throw UsageError("Panoptic's file names hold at most 100 cameras of one panel, here are " +
                     std::to_string(rig->cameras.size()));
  std::string mapping;
  for (size_t i = 0; i < rig->cameras.size(); ++i) {
    const std::string name = Format("00_%02d", static_cast<int>(i));
    mapping += (i ? ", " : "") + rig->cameras[i].camera.name + "=" + name;
    result->metrics["renamed"][rig->cameras[i].camera.name] = name;
    rig->cameras[i].camera.name = name;
  }
  result->warnings.push_back({"CAL-RENAMED", "Panoptic names its cameras 00_NN; renamed in order: " + mapping,
                              "choose the names yourself with --rename OLD=NEW"});
}

/// Formats of whole datasets that hold the cameras by themselves too.
std::vector<std::string> DatasetFormats() {
  std::vector<std::string> names;
  for (const exports::FormatInfo& format : exports::Formats()) {
    if (format.rig_only) names.push_back(format.name);
  }
  return names;
}

std::vector<std::string> OutputNames() {
  std::vector<std::string> names;
  for (const CalibrationFormat format : calib::kAllCalibrationFormats) names.emplace_back(ToString(format));
  for (const std::string& name : DatasetFormats()) names.push_back(name);
  return names;
}

std::vector<std::string> OutputChoices() {
  std::vector<std::string> choices = OutputNames();
  for (const char* alias : {"qualisys", "pose2sim", "aniposelib"}) choices.emplace_back(alias);
  return choices;
}

/// Writes a dataset format's cameras; returns the files.
std::vector<std::string> WriteDatasetFormat(const Arguments& arguments, const Rig& rig, CommandResult* result) {
  if (arguments.out_unit != calib::LengthUnit::kMetre)
    throw UsageError("--out-unit: " + arguments.to + " has a unit of its own");
  const bool one_file = exports::IsRigFile(exports::FormatByName(arguments.to), arguments.out);
  const exports::ExportReport report = exports::WriteRig(rig, arguments.to, arguments.out);
  std::vector<std::string> files;
  for (const std::string& file : report.files) files.push_back(one_file ? arguments.out : arguments.out + "/" + file);
  Append(report.notes, &result->warnings);
  for (const exports::ExportedCamera& camera : report.cameras) {
    if (camera.name != camera.source) result->metrics["renamed"][camera.source] = camera.name;
  }
  return files;
}

/// Writes the rig; returns the files.
std::vector<std::string> Write(const Arguments& arguments, CalibrationFormat format, Rig* rig, CommandResult* result) {
  calib::WriteOptions options;
  options.metres_per_unit = MetresPer(arguments.out_unit);
  options.allow_approximation_px = arguments.read.allow_approximation_px;
  options.qca_distortion_divisor = arguments.read.qca_distortion_divisor;
  if (format != CalibrationFormat::kPanoptic) {
    const calib::ExportReport report = calib::WriteCalibration(*rig, format, arguments.out, options);
    stages::AddNotes(report.notes, result);
    return report.files;
  }
  std::vector<Notice> notes;
  *rig = calib::RigForFormat(*rig, format, options, arguments.out, &notes);
  stages::AddNotes(notes, result);
  RenameForPanoptic(rig, result);
  dataset::WritePanopticCalibration(*rig, arguments.out, std::filesystem::path(arguments.in.front()).filename().string());
  return {arguments.out};
}

/// Whether --out is the name of a file of this format, and not of a folder for its files.
bool IsFile(const Arguments& arguments, CalibrationFormat format) {
  if (std::filesystem::is_directory(arguments.out) || HasFolderForm(arguments.out)) return false;
  if (calib::IsDatasetLayout(format)) return exports::IsRigFile(exports::FormatByName(arguments.to), arguments.out);
  const std::string ending = std::filesystem::path(arguments.out).extension().string();
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

CommandResult Convert(Arguments arguments) {
  calib::ImportedRig imported = stages::ReadCalibrationFiles(arguments.in, arguments.read);
  CommandResult result;
  result.inputs = arguments.in;
  stages::AddNotes(imported.notes, &result);
  Rename(arguments.rename, &imported.rig);
  // Layouts of datasets that cannot be read back have no name among the formats, and are written like those that can.
  const CalibrationFormat format = calib::CalibrationFormatFromString(arguments.to).value_or(CalibrationFormat::kNpz);
  const bool is_layout = calib::IsDatasetLayout(format);
  const bool file = IsFile(arguments, format);
  if (!file) arguments.out = OutputName(arguments.out, OutputKind::kFolder);
  const auto in_folder =
      file ? nullptr : std::make_unique<OutputFolder>(arguments.out, arguments.in, std::vector<std::string>());
  const auto as_file = file ? std::make_unique<OutputFiles>(std::vector<std::string>{arguments.out}, arguments.in) : nullptr;
  FilesTogether together;
  for (const std::string& written :
       is_layout ? WriteDatasetFormat(arguments, imported.rig, &result) : Write(arguments, format, &imported.rig, &result)) {
    result.outputs.push_back({written, "calibration"});
  }
  together.Commit();
  stages::AddCameraMetrics(imported.rig, &result);
  result.metrics["format"] = is_layout ? arguments.to : std::string(ToString(format));
  result.folder = file ? std::filesystem::path(PathOnDisk(arguments.out)).parent_path().string() : arguments.out;
  result.text = std::to_string(imported.rig.cameras.size()) + " cameras -> " + arguments.out + " (" + arguments.to + ")";
  return result;
}

}  // namespace

void RegisterCalibConvert(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = calib.add_subcommand("convert", "Read a calibration of any known program and write it for another");
  AddOption(sub, "IN", arguments->in, "calibration file or folder (opencv, mrcal, easymocap: several)")->required();
  AddOption(sub, "--to", arguments->to, "format of the output: " + Join(OutputNames(), ", "))
      ->capture_default_str()
      ->type_name("FORMAT")
      ->transform(OneOf(OutputChoices()));
  AddOutput(sub, "--out", arguments->out, OutputKind::kAny,
            "file to write; a folder for colmap and easymocap, and for opencv and mrcal with several cameras; the formats of "
            "datasets write the file alone where the name ends as it does (.npz, .glb, .ply, …)")
      ->required();
  AddChoice(sub, "--out-unit", arguments->out_unit, "unit of length to write in formats that name none: m, cm, mm or in")
      ->capture_default_str()
      ->check(OneOf({"m", "cm", "mm", "in"}));
  AddOption(sub, "--rename", arguments->rename, "OLD=NEW, give a camera another name; may be repeated")->take_all();
  AddReadOptions(sub, arguments->read);
  registry.Add(sub, "calib convert", [arguments](CommandContext&) { return Convert(*arguments); });
}

}  // namespace mvstudio::cli
