#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

#include "calib/formats.h"
#include "cli/commands.h"
#include "core/error.h"
#include "core/units.h"
#include "dataset/panoptic.h"
#include "geometry/alignment.h"
#include "geometry/rig_io.h"

namespace mvstudio::cli {
namespace {

using calib::CalibrationFormat;
using calib::ImportedRig;
using geometry::Rig;
using geometry::RigCamera;

/// How calibrations are read by all three subcommands.
struct ReadOptions {
  std::string from = "auto", size, unit = "m";
  double qca_distortion_divisor = 64;
};

struct ConvertOptions {
  ReadOptions read;
  std::vector<std::string> in, rename;
  std::string to = "mvstudio", out;
};

struct CompareOptions {
  ReadOptions read;
  std::string rig, reference;
  double max_rotation_deg = 0, max_translation_mm = 0, max_focal_percent = 0, max_lens_px = 0;
};

struct ShowOptions {
  ReadOptions read;
  std::vector<std::string> in;
};

template <class... Values>
std::string Format(const char* format, Values... values) {
  char line[512];
  std::snprintf(line, sizeof line, format, values...);
  return line;
}

void AddReadOptions(CLI::App* sub, ReadOptions& options) {
  sub->add_option("--from", options.from,
                  "format of the input: auto, mvstudio, panoptic, qualisys (TOML of Pose2Sim, Caliscope), qca, opencv")
      ->capture_default_str()
      ->check(CLI::IsMember({"auto", "mvstudio", "panoptic", "qualisys", "qca", "opencv"}));
  sub->add_option("--size", options.size, "WIDTHxHEIGHT px; opencv: image size when the file does not give it");
  sub->add_option("--unit", options.unit, "opencv: unit of the translation T")
      ->capture_default_str()
      ->check(CLI::IsMember({"m", "cm", "mm"}));
  sub->add_option("--qca-distortion-divisor", options.qca_distortion_divisor,
                  "qca: the distortion is divided by this (64: as Pose2Sim does; 1: coefficients as they stand)")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
}

calib::OpenCvOptions OpenCvOptionsFrom(const ReadOptions& options) {
  calib::OpenCvOptions opencv;
  char end = 0;
  if (!options.size.empty() && (std::sscanf(options.size.c_str(), "%dx%d%c", &opencv.width_px, &opencv.height_px, &end) != 2 ||
                                opencv.width_px <= 0 || opencv.height_px <= 0)) {
    throw UsageError("--size " + options.size + ": expected WIDTHxHEIGHT in pixels, e.g. --size 640x480");
  }
  opencv.metres_per_unit = options.unit == "mm" ? 1e-3 : options.unit == "cm" ? 1e-2 : 1.0;
  return opencv;
}

ImportedRig ReadAny(const std::vector<std::string>& paths, const ReadOptions& options) {
  const std::string& path = paths.front();
  const auto named = calib::CalibrationFormatFromString(options.from);
  const CalibrationFormat format = named ? *named : calib::DetectFormat(path);
  if (paths.size() > 1 && format != CalibrationFormat::kOpenCvYaml) {
    throw UsageError(paths[1] + ": only opencv calibrations may be spread over several files");
  }
  switch (format) {
    case CalibrationFormat::kPanoptic:
      return {dataset::ReadPanopticCalibration(path), {}};
    case CalibrationFormat::kQualisysToml:
      return calib::ReadQualisysToml(path);
    case CalibrationFormat::kQca:
      return calib::ReadQca(path, {options.qca_distortion_divisor});
    case CalibrationFormat::kOpenCvYaml:
      return calib::ReadOpenCvYaml(paths, OpenCvOptionsFrom(options));
    case CalibrationFormat::kMvstudio:
      break;
  }
  return {geometry::ReadRig(path), {}};
}

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

void AddCameras(const Rig& rig, CommandResult* result) {
  result->metrics["num_cameras"] = rig.cameras.size();
  auto& list = result->metrics["cameras"] = nlohmann::ordered_json::array();
  for (const RigCamera& camera : rig.cameras) {
    const Eigen::Vector3d centre = camera.CenterInWorld() + Eigen::Vector3d::Zero();  // no -0
    const double valid = geometry::ValidRadius(camera.camera);
    nlohmann::ordered_json entry = {{"name", camera.camera.name},
                                    {"model", geometry::ToString(camera.camera.model)},
                                    {"size_px", {camera.camera.width_px, camera.camera.height_px}},
                                    {"focal_px", {camera.camera.fx(), camera.camera.fy()}},
                                    {"center_px", {camera.camera.cx(), camera.camera.cy()}},
                                    {"center_in_world_m", {centre[0], centre[1], centre[2]}}};
    entry["valid_radius"] = std::isfinite(valid) ? nlohmann::ordered_json(valid) : nlohmann::ordered_json();
    list.push_back(entry);
  }
}

void AddNotes(const std::vector<calib::ImportNote>& notes, CommandResult* result) {
  for (const calib::ImportNote& note : notes) result->warnings.push_back({note.code, note.text, note.hint});
}

std::string Table(const Rig& rig) {
  std::string text =
      Format("%-12s %-10s %11s %20s %20s %28s\n", "camera", "lens", "size px", "focal px", "centre px", "position in world m");
  for (const RigCamera& camera : rig.cameras) {
    const geometry::Camera& c = camera.camera;
    const Eigen::Vector3d at = camera.CenterInWorld() + Eigen::Vector3d::Zero();  // no -0
    text += Format("%-12s %-10s %5d x %-5d %10.3f %9.3f %10.3f %9.3f %9.4f %8.4f %8.4f\n", c.name.c_str(),
                   std::string(geometry::ToString(c.model)).c_str(), c.width_px, c.height_px, c.fx(), c.fy(), c.cx(), c.cy(),
                   at[0], at[1], at[2]);
    for (Eigen::Index i = 4; i < c.params.size(); ++i) {
      text += (i == 4 ? "             " : " ") + geometry::ParamNames(c.model)[i] + Format("=%.6g", c.params[i]);
    }
    if (c.params.size() > 4) text += "\n";
  }
  return text + "world frame fixed by: " + (rig.gauge.empty() ? "(not said)" : rig.gauge);
}

CommandResult Convert(const ConvertOptions& options) {
  ImportedRig imported = ReadAny(options.in, options.read);
  CommandResult result;
  result.inputs = options.in;
  AddNotes(imported.notes, &result);
  Rename(options.rename, &imported.rig);
  if (options.to == "panoptic") {
    RenameForPanoptic(&imported.rig, &result);
    dataset::WritePanopticCalibration(imported.rig, options.out, std::filesystem::path(options.in.front()).filename().string());
  } else {
    geometry::WriteRig(imported.rig, options.out);
  }
  AddCameras(imported.rig, &result);
  result.outputs.push_back({options.out, "calibration"});
  result.folder = std::filesystem::absolute(options.out).parent_path().string();
  result.text = std::to_string(imported.rig.cameras.size()) + " cameras -> " + options.out + " (" + options.to + ")";
  return result;
}

CommandResult Show(const ShowOptions& options) {
  const ImportedRig imported = ReadAny(options.in, options.read);
  CommandResult result;
  result.inputs = options.in;
  AddNotes(imported.notes, &result);
  AddCameras(imported.rig, &result);
  result.metrics["gauge"] = imported.rig.gauge;
  result.text = Table(imported.rig);
  return result;
}

/// Keeps the cameras of `rig` that `other` has too; the rest are named in a warning.
void KeepCommon(const Rig& other, const std::string& path, Rig* rig, CommandResult* result) {
  std::string missing;
  std::vector<RigCamera> kept;
  for (const RigCamera& camera : rig->cameras) {
    if (other.Find(camera.camera.name) >= 0)
      kept.push_back(camera);
    else
      missing += (missing.empty() ? "" : ", ") + camera.camera.name;
  }
  if (!missing.empty())
    result->warnings.push_back({"CAL-NOTINBOTH", path + ": left out, not in the other file: " + missing,
                                "rename cameras with calib convert --rename"});
  rig->cameras = kept;
}

void AddDifference(const geometry::RigDifference& difference, const CompareOptions& options, CommandResult* result) {
  struct Row {
    const char* key;
    double value, mean, limit;
    const char* unit;
  };
  const Row rows[] = {{"rotation_deg", RadToDeg(difference.max_rotation_rad), RadToDeg(difference.mean_rotation_rad),
                       options.max_rotation_deg, "deg"},
                      {"translation_mm", 1e3 * difference.max_translation_m, 1e3 * difference.mean_translation_m,
                       options.max_translation_mm, "mm"},
                      {"focal_percent", 100 * difference.max_focal_relative, -1, options.max_focal_percent, "%"},
                      {"lens_px", difference.max_lens_px, -1, options.max_lens_px, "px"}};
  for (const Row& row : rows) {
    result->metrics[std::string("max_") + row.key] = row.value;
    if (row.mean >= 0) result->metrics[std::string("mean_") + row.key] = row.mean;
    result->text += Format("%-15s max %.6g %s", row.key, row.value, row.unit) +
                    (row.mean >= 0 ? Format(", mean %.6g %s", row.mean, row.unit) : "") + "\n";
    if (row.limit > 0 && row.value > row.limit) {
      result->exit = kExitQualityGate;
      result->warnings.push_back({"CAL-DIFFERS", Format("%s is %.6g, allowed %.6g", row.key, row.value, row.limit), ""});
    }
  }
}

CommandResult Compare(const CompareOptions& options) {
  ImportedRig rig = ReadAny({options.rig}, options.read), reference = ReadAny({options.reference}, options.read);
  CommandResult result;
  result.inputs = {options.rig, options.reference};
  AddNotes(rig.notes, &result);
  AddNotes(reference.notes, &result);
  KeepCommon(reference.rig, options.rig, &rig.rig, &result);
  KeepCommon(rig.rig, options.reference, &reference.rig, &result);
  if (rig.rig.cameras.empty())
    throw UsageError(options.rig + " and " + options.reference + ": no camera name is in both; use calib convert --rename");
  const geometry::RigDifference difference = geometry::CompareRigs(rig.rig, reference.rig);
  result.metrics["status"] = ToString(difference.status);
  result.metrics["num_cameras"] = rig.rig.cameras.size();
  if (difference.status != Status::kOk) {
    result.exit = kExitIllPosed;
    result.errors.push_back({"CAL-NOTALIGNED", "the rigs cannot be aligned: " + std::string(ToString(difference.status)), ""});
    return result;
  }
  AddDifference(difference, options, &result);
  result.text += std::to_string(rig.rig.cameras.size()) + " cameras, after the best rigid alignment";
  return result;
}

}  // namespace

void RegisterCalib(CLI::App& app, Registry& registry) {
  CLI::App* calib = app.add_subcommand("calib", "Convert, show and compare calibrations");
  calib->require_subcommand(1);

  const auto convert = std::make_shared<ConvertOptions>();
  CLI::App* sub = calib->add_subcommand("convert", "Read any known calibration and write ours or Panoptic's");
  sub->add_option("IN", convert->in, "calibration file (opencv: several)")->required();
  sub->add_option("--to", convert->to, "mvstudio or panoptic")
      ->capture_default_str()
      ->check(CLI::IsMember({"mvstudio", "panoptic"}));
  sub->add_option("--out", convert->out, "file to write")->required();
  sub->add_option("--rename", convert->rename, "OLD=NEW, give a camera another name; may be repeated")->take_all();
  AddReadOptions(sub, convert->read);
  registry.Add(sub, "calib convert", [convert](CommandContext&) { return Convert(*convert); });

  const auto show = std::make_shared<ShowOptions>();
  sub = calib->add_subcommand("show", "Print a calibration as a table");
  sub->add_option("IN", show->in, "calibration file (opencv: several)")->required();
  AddReadOptions(sub, show->read);
  registry.Add(sub, "calib show", [show](CommandContext&) { return Show(*show); });

  const auto compare = std::make_shared<CompareOptions>();
  sub = calib->add_subcommand("compare", "Difference of two calibrations after the rigid motion that aligns them best");
  sub->add_option("A", compare->rig, "calibration")->required();
  sub->add_option("B", compare->reference, "reference calibration")->required();
  sub->add_option("--max-rotation-deg", compare->max_rotation_deg, "exit 4 when a camera differs more; 0: no limit")
      ->capture_default_str();
  sub->add_option("--max-translation-mm", compare->max_translation_mm, "exit 4 when a camera differs more; 0: no limit")
      ->capture_default_str();
  sub->add_option("--max-focal-percent", compare->max_focal_percent, "exit 4 when a focal length differs more; 0: no limit")
      ->capture_default_str();
  sub->add_option("--max-lens-px", compare->max_lens_px,
                  "exit 4 when a ray's pixels through both lenses lie farther apart; 0: no limit")
      ->capture_default_str();
  AddReadOptions(sub, compare->read);
  registry.Add(sub, "calib compare", [compare](CommandContext&) { return Compare(*compare); });
}

}  // namespace mvstudio::cli
