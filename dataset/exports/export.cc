#include "dataset/exports/export.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/exports/writers.h"
#include "dataset/panoptic/in_view.h"

namespace mvstudio::exports {
namespace {

using Json = nlohmann::ordered_json;

constexpr ChoiceWords<ExportImages, 3> kImageWords = {
    {{ExportImages::kLink, "link"}, {ExportImages::kCopy, "copy"}, {ExportImages::kNone, "none"}}};
constexpr ChoiceWords<ExportUndistort, 3> kUndistortWords = {
    {{ExportUndistort::kAuto, "auto"}, {ExportUndistort::kAlways, "always"}, {ExportUndistort::kNever, "never"}}};
constexpr ChoiceWords<ExportNames, 2> kNameWords = {{{ExportNames::kDataset, "dataset"}, {ExportNames::kStudio, "studio"}}};
constexpr ChoiceWords<ExportMasks, 3> kMaskWords = {
    {{ExportMasks::kFolder, "folder"}, {ExportMasks::kAlpha, "alpha"}, {ExportMasks::kNone, "none"}}};

struct Writer {
  FormatInfo info;
  void (*write)(const Job&);
};

const std::vector<Writer>& Writers() {
  constexpr bool kTimeStep = true, kOneSize = true, kImages = true, kRigOnly = true, kAlpha = true;
  static const std::vector<Writer> writers = {
      {{"colmap", "COLMAP and Gaussian splatting: sparse model with surface points, images, masks", LensNeed::kBrown5,
        kTimeStep, !kOneSize, kImages, !kRigOnly, kAlpha},
       WriteColmap},
      {{"nerfstudio", "nerfstudio: transforms.json, images, masks, start points", LensNeed::kBrown4, kTimeStep, !kOneSize,
        kImages, !kRigOnly, kAlpha},
       WriteNerfstudio},
      {{"zju", "ZJU-MoCap / Neural Body: annots.npy, images, mask/, mask_cihp/", LensNeed::kBrown5, !kTimeStep, !kOneSize,
        kImages, kRigOnly, !kAlpha, ".npy"},
       WriteZju},
      {{"easymocap", "EasyMocap: intri.yml, extri.yml, images, mask, annots, keypoints3d", LensNeed::kBrown5, !kTimeStep,
        !kOneSize, kImages, !kRigOnly},
       WriteEasyMocap},
      {{"actorshq", "ActorsHQ / HumanRF: calibration.csv, aabbs.csv, rgbs, masks", LensNeed::kPinhole, !kTimeStep, !kOneSize,
        kImages, kRigOnly, !kAlpha, ".csv"},
       WriteActorsHq},
      {{"dynamic3dgs", "Dynamic 3D Gaussians: train_meta.json, test_meta.json, ims, seg, init_pt_cld.npz", LensNeed::kPinhole,
        !kTimeStep, kOneSize, kImages, !kRigOnly},
       WriteDynamic3dgs},
      {{"dna", "DNA-Rendering: SMC files (HDF5) with cameras, images, masks, keypoints", LensNeed::kBrown5, !kTimeStep,
        !kOneSize, kImages, kRigOnly, !kAlpha, ".smc"},
       WriteDna},
      {{"humman", "HuMMan-Recon: cameras.json, kinect_color, kinect_mask", LensNeed::kPinhole, !kTimeStep, !kOneSize, kImages,
        kRigOnly, !kAlpha, ".json"},
       WriteHumman},
      {{"trc", "joints as markers for OpenSim and Pose2Sim, a file per person", LensNeed::kAny, !kTimeStep, !kOneSize, !kImages,
        !kRigOnly},
       WriteTrc},
      {{"c3d", "joints as markers for motion capture programs, a file per person", LensNeed::kAny, !kTimeStep, !kOneSize,
        !kImages, !kRigOnly},
       WriteC3d},
      {{"bvh", "a skeleton with fixed bones for animation programs, a file per person", LensNeed::kAny, !kTimeStep, !kOneSize,
        !kImages, !kRigOnly},
       WriteBvh},
      {{"csv", "joints as a table", LensNeed::kAny, !kTimeStep, !kOneSize, !kImages, !kRigOnly, !kAlpha, "", ".csv"}, WriteCsv},
      {{"npz", "joints and cameras as numpy arrays", LensNeed::kBrown5, !kTimeStep, !kOneSize, !kImages, kRigOnly, !kAlpha,
        ".npz", ".npz"},
       WriteNpz},
      {{"gltf", "cameras and animated skeletons for 3D viewers, one .glb", LensNeed::kAny, !kTimeStep, !kOneSize, !kImages,
        kRigOnly, !kAlpha, ".glb", ".glb"},
       WriteGltf},
      {{"ply", "cameras and skeletons as lines, for mesh viewers", LensNeed::kAny, !kTimeStep, !kOneSize, !kImages, kRigOnly,
        !kAlpha, ".ply"},
       WritePly},
      {{"blender", "Blender: a script that makes the cameras with their shift, calibration.json, background images",
        LensNeed::kPinhole, !kTimeStep, !kOneSize, kImages, kRigOnly},
       WriteBlender},
      {{"ros", "ROS: a camera_info file for each camera, without poses", LensNeed::kAny, !kTimeStep, !kOneSize, !kImages,
        kRigOnly},
       WriteRos},
      {{"mcap", "MCAP with messages of ROS 2, for Rerun and Foxglove: cameras, images, joints, in one file", LensNeed::kPinhole,
        !kTimeStep, !kOneSize, kImages, !kRigOnly, !kAlpha, "", ".mcap"},
       WriteMcap},
  };
  return writers;
}

/// What readers of a format without a writer take as well.
std::string FormatInstead(const std::string& name) {
  std::string lower = name;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const auto names = [&](std::initializer_list<const char*> words) {
    return std::any_of(words.begin(), words.end(), [&](const char* word) { return lower.find(word) != std::string::npos; });
  };
  if (names({"gaussian", "splat", "3dgs"}))
    return "; programs for Gaussian splatting read colmap, of moving scenes dynamic3dgs";
  if (names({"usd", "fbx", "abc", "alembic", "maya", "unreal", "unity"}))
    return "; Blender and Unreal read gltf (cameras, skeletons), animation programs bvh (joints); the person's surface is the "
           "body.glb of `mvstudio avatar fit`";
  return "";
}

const Writer& WriterByName(const std::string& name) {
  for (const Writer& writer : Writers()) {
    if (writer.info.name == name) return writer;
  }
  const std::string known = Join(Writers(), ", ", [](const Writer& writer) { return writer.info.name; });
  throw UsageError("unknown format '" + name + "'; known are " + known + FormatInstead(name));
}

Json CameraJson(const View& view) {
  const geometry::Camera& lens = view.camera.camera;
  Json json = {{"name", view.info.name}, {"dataset_name", view.info.source}, {"studio_name", view.info.studio}};
  if (view.info.part != dataset::PartOfSplit::kNone) json["part"] = ToString(view.info.part);
  json["undistorted"] = view.info.undistorted;
  if (view.info.undistorted) json["lost_share"] = view.info.lost_share;
  json["size_px"] = {lens.width_px, lens.height_px};
  json["model"] = std::string(ToString(lens.model));
  json["params"] = std::vector<double>(lens.params.data(), lens.params.data() + lens.params.size());
  return json;
}

/// What the format itself has no place for.
std::string ManifestText(const Take& take, const ExportReport& report, const std::string& masks_as) {
  Json json = {{"schema", "mvstudio.export/1"}, {"format", report.format},
               {"sequence", take.sequence},     {"frame_rate_hz", take.frame_rate_hz},
               {"frames", take.frames},         {"pictures", report.images},
               {"masks", report.masks},         {"masks_as", masks_as},
               {"points", report.points},       {"cameras", Json::array()},
               {"files", report.files}};
  for (const View& view : take.views) json["cameras"].push_back(CameraJson(view));
  json["notes"] = Json::array();
  for (const Notice& note : report.notes) json["notes"].push_back({{"code", note.code}, {"text", note.text}});
  // Names are arbitrary bytes.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void NoteMissing(const FormatInfo& format, const ExportOptions& options, ExportReport* report) {
  if (!format.has_images || options.images == ExportImages::kNone) return;
  if (report->missing_images > 0) {
    dataset::MissingImages images = report->missing;
    for (auto& [camera, of] : images.by_camera) of.no_mask.clear();
    report->notes.push_back({"EXP-NO-PICTURE",
                             std::to_string(report->missing_images) + " images are not in the dataset (" +
                                 dataset::MissingCamerasText(images) + ")",
                             "`mvstudio dataset verify` counts them; option 'frames' and option 'cameras' leave them out"});
  }
  if (report->missing_masks > 0) {
    report->notes.push_back({"EXP-NO-MASK",
                             std::to_string(report->missing_masks) + " masks are not in the dataset" +
                                 (options.masks == ExportMasks::kAlpha ? "; these images are opaque"
                                  : OpensEveryMask(format.name)        ? "; the format's reader stops at an image without one"
                                                                       : ""),
                             "make them with `mvstudio mask`"});
  }
}

bool IsFile(const std::string& ending, const std::string& path) {
  std::error_code ignored;
  return !ending.empty() && std::filesystem::path(path).extension() == ending && !std::filesystem::is_directory(path, ignored);
}

void FillFromTake(const Take& take, ExportReport* report) {
  for (const View& view : take.views) report->cameras.push_back(view.info);
  report->frames = take.frames;
  report->people = static_cast<int>(take.PersonIds().size());
}

void WriteOneFile(const Writer& writer, const Take& take, const std::string& root, const std::string& out,
                  const ExportOptions& options, const RunContext& run, ExportReport* report) {
  const OutputFiles place({out}, {root, options.split});
  const std::string folder = std::filesystem::path(out).parent_path().string();
  Images images(take, options, folder);
  writer.write({take, images, options, run, folder, report, out});
  images.Run(run, report);
  images.RequireAny();
  NoteMissing(writer.info, options, report);
  FillFromTake(take, report);
}

}  // namespace

std::string_view ToString(ExportImages images) { return WordOf(kImageWords, images); }
std::string_view ToString(ExportUndistort undistort) { return WordOf(kUndistortWords, undistort); }
std::string_view ToString(ExportNames names) { return WordOf(kNameWords, names); }
std::string_view ToString(ExportMasks masks) { return WordOf(kMaskWords, masks); }

void FromString(const std::string& text, ExportImages* images) {
  *images = KnownChoice(kImageWords, text, "option 'pictures' " + text + ": must be one of link, copy, none");
}

void FromString(const std::string& text, ExportUndistort* undistort) {
  *undistort = KnownChoice(kUndistortWords, text, "option 'undistort' " + text + ": must be one of auto, always, never");
}

void FromString(const std::string& text, ExportNames* names) {
  *names = KnownChoice(kNameWords, text, "option 'names' " + text + ": must be one of dataset, studio");
}

void FromString(const std::string& text, ExportMasks* masks) {
  *masks = KnownChoice(kMaskWords, text, "option 'masks' " + text + ": must be one of folder, alpha, none");
}

const std::vector<FormatInfo>& Formats() {
  static const std::vector<FormatInfo> formats = [] {
    std::vector<FormatInfo> list;
    for (const Writer& writer : Writers()) list.push_back(writer.info);
    return list;
  }();
  return formats;
}

const FormatInfo& FormatByName(const std::string& name) { return WriterByName(name).info; }

bool IsRigFile(const FormatInfo& format, const std::string& path) { return IsFile(format.rig_file, path); }
bool IsDatasetFile(const FormatInfo& format, const std::string& path) { return IsFile(format.one_file, path); }

ExportReport ExportDataset(const dataset::PanopticDataset& dataset, const std::string& format, const std::string& out,
                           const ExportOptions& options, const RunContext& run) {
  const Writer& writer = WriterByName(format);
  ExportReport report;
  report.format = format;
  if (!IsDatasetFile(writer.info, out)) RequireFolderName(out);
  if (writer.info.has_images && !dataset.root.empty()) dataset::RequireInView(dataset, true);
  const std::string metres = dataset.root.empty() ? "" : dataset::MetresConflict(dataset.rig);
  if (!metres.empty())
    report.notes.push_back({"DAT-UNITS", metres, "the export has lengths of a hundredth: multiply t and joints by 100 first"});
  const Take take = PrepareTake(dataset, writer.info, options, &report);
  if (IsDatasetFile(writer.info, out)) {
    WriteOneFile(writer, take, dataset.root, out, options, run, &report);
    return report;
  }
  AtomicFolder folder(out, options.overwrite, {dataset.root, options.split});
  Images images(take, options, folder.work_path());
  const Job job{take, images, options, run, folder.work_path(), &report};
  NoteReaderLimits(job);
  writer.write(job);
  images.Run(run, &report);
  images.RequireAny();
  NoteMissing(writer.info, options, &report);
  FillFromTake(take, &report);
  if (take.split) {
    dataset::WriteSplit(*take.split, folder.work_path() + "/split.json");
    report.files.push_back("split.json");
  }
  WriteFileAtomic(folder.work_path() + "/export.json", ManifestText(take, report, std::string(ToString(options.masks))));
  folder.Commit();
  return report;
}

ExportReport WriteRig(const geometry::Rig& rig, const std::string& format, const std::string& path) {
  const Writer& writer = WriterByName(format);
  if (!writer.info.rig_only) throw UsageError(format + " needs more than a calibration: use `mvstudio dataset export`");
  if (rig.cameras.empty()) throw UsageError("a rig without cameras cannot be written");
  ExportReport report;
  report.format = format;
  ExportOptions options;
  options.images = ExportImages::kNone;
  const Take take = TakeOfRig(rig, writer.info, path, &report);
  Images images(take, options, path);
  const bool one_file = IsRigFile(writer.info, path);
  const Job job{take, images, options, {}, path, &report, one_file ? path : ""};
  NoteReaderLimits(job);
  writer.write(job);
  for (const View& view : take.views) report.cameras.push_back(view.info);
  // Names and image sizes, for which some formats have no place.
  if (!one_file) job.Write("export.json", ManifestText(take, report, std::string(ToString(ExportMasks::kNone))));
  return report;
}

}  // namespace mvstudio::exports
