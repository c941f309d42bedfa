#include "stages/pack_speed/run.h"

#include <algorithm>
#include <cstdlib>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"

namespace mvstudio::stages {
namespace {

std::vector<int> CropSizes(const std::vector<std::string>& texts) {
  std::vector<int> sizes;
  for (const std::string& text : texts) {
    char* end = nullptr;
    const long size = text == "full" ? 0 : std::strtol(text.c_str(), &end, 10);
    if (text != "full" && (*end || size < 16 || size > 4096))
      throw UsageError("option 'crops': 16 to 4096 px or full, not '" + text + "'");
    sizes.push_back(static_cast<int>(size));
  }
  return sizes;
}

std::vector<bool> FrontOfEach(const std::vector<PackSpeedTrial>& trials) {
  std::vector<bool> on_front;
  for (const PackSpeedTrial& a : trials) {
    on_front.push_back(std::none_of(trials.begin(), trials.end(), [&a](const PackSpeedTrial& b) {
      if (a.crop_px != b.crop_px || a.threads != b.threads) return false;
      const bool no_worse =
          b.crops_per_s >= a.crops_per_s && b.bytes_per_crop <= a.bytes_per_crop && b.rms_levels <= a.rms_levels;
      return no_worse && (b.crops_per_s > a.crops_per_s || b.bytes_per_crop < a.bytes_per_crop || b.rms_levels < a.rms_levels);
    }));
  }
  return on_front;
}

}  // namespace

PackTradeoffReport RunPackTradeoff(const PackTradeoffOptions& options, const RunContext& run) {
  PackSpeedOptions how = options.how;
  how.crops = CropSizes(options.crops);
  dataset::OpenPanopticDataset(options.folder);  // refused before a folder is made
  const ScratchFolder work(options.out);
  how.work = work.path();
  PackTradeoffReport report;
  report.folder = options.folder, report.out = options.out;
  report.speed = MeasurePackSpeed(options.folder, how, run);
  report.on_front = FrontOfEach(report.speed.trials);
  report.page = options.out + "/tradeoff-pack.html";
  WriteFileAtomic(report.page, PackSpeedPage(report.speed, report.on_front));
  return report;
}

CommandResult Describe(const PackTradeoffReport& report) {
  CommandResult result;
  result.inputs = {report.folder};
  result.metrics = nlohmann::ordered_json::parse(PackSpeedJson(report.speed, report.on_front));
  result.text = PackSpeedText(report.speed, report.on_front);
  result.outputs.push_back({report.page, "figure"});
  result.folder = report.out;
  return result;
}

}  // namespace mvstudio::stages
