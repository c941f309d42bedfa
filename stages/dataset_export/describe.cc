#include "stages/dataset_export/describe.h"

#include <algorithm>
#include <filesystem>

#include "core/disk/place.h"
#include "core/format.h"
#include "stages/input/mask_notice.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json ExportMetrics(const exports::ExportReport& report) {
  ordered_json metrics = {{"format", report.format},
                          {"num_cameras", report.cameras.size()},
                          {"num_frames", report.frames.size()},
                          {"people", report.people},
                          {"pictures", report.images},
                          {"masks", report.masks},
                          {"points", report.points},
                          {"linked", report.linked},
                          {"missing_pictures", report.missing_images},
                          {"missing_masks", report.missing_masks}};
  metrics["missing"] = ordered_json::parse(dataset::MissingToJsonText(report.missing));
  for (const auto& [name, value] : report.figures) metrics[name] = FiniteOrNull(value);
  metrics["cameras"] = ordered_json::array();
  for (const exports::ExportedCamera& camera : report.cameras) {
    metrics["cameras"].push_back({{"name", camera.name},
                                  {"dataset_name", camera.source},
                                  {"studio_name", camera.studio},
                                  {"undistorted", camera.undistorted},
                                  {"lost_share", FiniteOrNull(camera.lost_share)}});
  }
  return metrics;
}

constexpr size_t kListedExportFiles = 20;

}  // namespace

CommandResult Describe(const DatasetExportReport& report) {
  const DatasetExportOptions& options = report.options;
  const exports::ExportReport& written = report.written;
  CommandResult result;
  result.inputs = {options.dataset};
  if (!options.layout.split.empty()) result.inputs.push_back(options.layout.split);
  result.folder = report.one_file ? std::filesystem::path(PathOnDisk(options.out)).parent_path().string() : options.out;
  result.outputs.push_back({options.out, "export"});
  for (size_t i = 0; !report.one_file && i < std::min(written.files.size(), kListedExportFiles); ++i) {
    result.outputs.push_back({options.out + "/" + written.files[i], "export-file"});
  }
  result.metrics = ExportMetrics(written);
  Append(written.notes, &result.warnings);
  result.text = options.out + Format(": %zu cameras, %zu frames, %d people, %d images, %d masks, %d points (%s)\n",
                                     written.cameras.size(), written.frames.size(), written.people, written.images,
                                     written.masks, written.points, options.to.c_str());
  if (written.masks > 0) result.Add(DescribeMaskMeaning(report.masks, options.dataset + "/masks", result.text));
  if (written.missing_images > 0) result.exit = kExitPartial;
  if (written.people == 0 && written.images == 0) {
    result.exit = kExitQualityGate;
    result.errors.push_back({"EXP-NOBODY", "the chosen frames hold nobody's joints and no image: cameras alone were written",
                             "choose other option 'frames'"});
  }
  return result;
}

}  // namespace mvstudio::stages
