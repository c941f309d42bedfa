#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "stages/dataset/pack_speed.h"
#include "stages/study/tradeoff.h"

namespace mvstudio::cli {
namespace {

struct Arguments {
  std::string folder, out;
  std::vector<std::string> crops{"96", "128", "256", "full"};
  stages::PackSpeedOptions options;
};

std::vector<int> CropSizes(const std::vector<std::string>& texts) {
  std::vector<int> sizes;
  for (const std::string& text : texts) {
    char* end = nullptr;
    const long size = text == "full" ? 0 : std::strtol(text.c_str(), &end, 10);
    if (text != "full" && (*end || size < 16 || size > 4096))
      throw UsageError("--crops: 16 to 4096 px or full, not '" + text + "'");
    sizes.push_back(static_cast<int>(size));
  }
  return sizes;
}

/// True where no other way of the same crop size and threads is at least as fast, as small and as good, and better in one.
std::vector<bool> FrontOfEach(const std::vector<stages::PackSpeedTrial>& trials) {
  std::vector<bool> on_front;
  for (const stages::PackSpeedTrial& a : trials) {
    on_front.push_back(std::none_of(trials.begin(), trials.end(), [&a](const stages::PackSpeedTrial& b) {
      if (a.crop_px != b.crop_px || a.threads != b.threads) return false;
      const bool no_worse =
          b.crops_per_s >= a.crops_per_s && b.bytes_per_crop <= a.bytes_per_crop && b.rms_levels <= a.rms_levels;
      return no_worse && (b.crops_per_s > a.crops_per_s || b.bytes_per_crop < a.bytes_per_crop || b.rms_levels < a.rms_levels);
    }));
  }
  return on_front;
}

CommandResult Run(Arguments& arguments, const CommandContext& context) {
  CommandResult result;
  result.inputs = {arguments.folder};
  arguments.options.crops = CropSizes(arguments.crops);
  dataset::OpenPanopticDataset(arguments.folder);  // refused before a folder is made
  const ScratchFolder work(arguments.out);
  arguments.options.work = work.path();
  const stages::PackSpeedReport report = stages::MeasurePackSpeed(arguments.folder, arguments.options, context.run);
  const std::vector<bool> on_front = FrontOfEach(report.trials);
  result.metrics = nlohmann::ordered_json::parse(stages::PackSpeedJson(report, on_front));
  result.text = stages::PackSpeedText(report, on_front);
  const std::string page = arguments.out + "/tradeoff-pack.html";
  WriteFileAtomic(page, stages::PackSpeedPage(report, on_front));
  result.outputs.push_back({page, "figure"});
  result.folder = arguments.out;
  return result;
}

}  // namespace

void RegisterTradeoffPack(CLI::App& tradeoff, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = tradeoff.add_subcommand("pack",
                                          "Image codec x crop size x threads: crops a second at random, bytes a crop and PSNR, "
                                          "packs beside a JPEG folder that is cropped when read");
  stages::PackSpeedOptions& o = arguments->options;
  AddOption(sub, "folder", arguments->folder, "dataset folder")->required();
  AddOption(sub, "--codecs", o.codecs, "of the packs: raw, png, jpeg:Q")->delimiter(',')->capture_default_str();
  AddOption(sub, "--crops", arguments->crops, "px, or full for whole images")->delimiter(',')->capture_default_str();
  AddOption(sub, "--threads-list", o.threads, "numbers of reading threads")->delimiter(',')->capture_default_str();
  AddOption(sub, "--frames", o.frames, "frames of the dataset, evenly spread")->capture_default_str();
  AddOption(sub, "--folder-quality", o.folder_quality, "of the JPEG folder made for comparison")->capture_default_str();
  AddOption(sub, "--seconds", o.seconds, "of reading, each way")->capture_default_str();
  AddOption(sub, "--lossless", o.lossless,
            "dataset with the same images as PNG: packs are made from it and PSNR is against it");
  AddOutput(sub, "--out", arguments->out, OutputKind::kFolder,
            "folder for the table and the figures; needs room for the packs meanwhile")
      ->required();
  registry.Add(sub, "tradeoff pack", [arguments](CommandContext& context) { return Run(*arguments, context); });
}

}  // namespace mvstudio::cli
