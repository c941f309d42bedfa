#include "stages/dataset_export/run.h"

#include <filesystem>
#include <utility>

#include "core/disk/place.h"
#include "core/join.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/panoptic/sequence.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

exports::ExportOptions LayoutToExport(const DatasetExportOptions& options) {
  exports::ExportOptions layout = options.layout;
  layout.cameras = SplitCommas(Join(layout.cameras, ","));  // "00_00,00_03" and repeated options alike
  if (options.frames.empty()) return layout;
  layout.all_frames = options.frames == "all";
  if (!layout.all_frames) layout.frames = ParseRanges("option 'frames'", options.frames);
  return layout;
}

/// Cameras and joints of a folder without images, as Panoptic's sequences are before their videos are fetched.
dataset::PanopticDataset OpenWithoutImages(const std::string& root) {
  dataset::PanopticDataset dataset;
  dataset.root = root;
  const std::string calibration = dataset::FindPanopticCalibration(root);
  dataset.sequence = std::filesystem::path(calibration).stem().string().substr(std::string("calibration_").size());
  dataset.rig = dataset::ReadPanopticCalibration(calibration);
  dataset.aliases = dataset::ReadPanopticAliases(root);
  dataset::ReadJoints(&dataset);
  return dataset;
}

dataset::PanopticDataset OpenToExport(const DatasetExportOptions& options) {
  const bool wants_images =
      exports::FormatByName(options.to).has_images && options.layout.images != exports::ExportImages::kNone;
  const bool has_images = std::filesystem::exists(options.dataset + "/hdImgs");
  return wants_images || has_images ? dataset::OpenPanopticDataset(options.dataset) : OpenWithoutImages(options.dataset);
}

}  // namespace

DatasetExportReport RunDatasetExport(DatasetExportOptions options, const RunContext& run) {
  DatasetExportReport report;
  report.one_file = exports::IsDatasetFile(exports::FormatByName(options.to), options.out);
  if (!report.one_file) options.out = OutputName(options.out, OutputKind::kFolder);
  options.layout = LayoutToExport(options);
  const dataset::PanopticDataset dataset = OpenToExport(options);
  report.written = exports::ExportDataset(dataset, options.to, options.out, options.layout, run);
  if (report.written.masks > 0) report.masks = dataset.Masks();
  report.options = std::move(options);
  return report;
}

}  // namespace mvstudio::stages
