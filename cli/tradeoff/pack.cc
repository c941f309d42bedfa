#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "stages/pack_speed/run.h"

namespace mvstudio::cli {

void RegisterTradeoffPack(CLI::App& tradeoff, Registry& registry) {
  const auto options = std::make_shared<stages::PackTradeoffOptions>();
  CLI::App* sub = tradeoff.add_subcommand("pack",
                                          "Image codec x crop size x threads: crops a second at random, bytes a crop and PSNR, "
                                          "packs beside a JPEG folder that is cropped when read");
  stages::PackSpeedOptions& o = options->how;
  AddOption(sub, "folder", options->folder, "dataset folder")->required();
  AddOption(sub, "--codecs", o.codecs, "of the packs: raw, png, jpeg:Q")->delimiter(',')->capture_default_str();
  AddOption(sub, "--crops", options->crops, "px, or full for whole images")->delimiter(',')->capture_default_str();
  AddOption(sub, "--threads-list", o.threads, "numbers of reading threads")->delimiter(',')->capture_default_str();
  AddOption(sub, "--frames", o.frames, "frames of the dataset, evenly spread")->capture_default_str();
  AddOption(sub, "--folder-quality", o.folder_quality, "of the JPEG folder made for comparison")->capture_default_str();
  AddOption(sub, "--seconds", o.seconds, "of reading, each way")->capture_default_str();
  AddOption(sub, "--lossless", o.lossless,
            "dataset with the same images as PNG: packs are made from it and PSNR is against it");
  AddOutput(sub, "--out", options->out, OutputKind::kFolder,
            "folder for the table and the figures; needs room for the packs meanwhile")
      ->required();
  registry.Add(sub, "tradeoff pack",
               [options](CommandContext& context) { return Describe(RunPackTradeoff(*options, context.run)); });
}

}  // namespace mvstudio::cli
