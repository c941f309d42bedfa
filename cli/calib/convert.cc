#include "cli/calib/calib.h"
#include "cli/program/arguments.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/calib_files/describe.h"

namespace mvstudio::cli {

void RegisterCalibConvert(CLI::App& calib, Registry& registry) {
  const auto options = std::make_shared<stages::CalibConvertOptions>();
  CLI::App* sub = calib.add_subcommand("convert", "Read a calibration of any known program and write it for another");
  AddOption(sub, "IN", options->in, "calibration file or folder (opencv, mrcal, easymocap: several)")->required();
  AddOptions(sub, *options);
  std::vector<std::string> words = stages::CalibOutputNames();
  for (const char* alias : {"qualisys", "pose2sim", "aniposelib"}) words.emplace_back(alias);
  sub->get_option("--to")->type_name("FORMAT")->transform(OneOf(words));
  sub->get_option("--out")->required();
  sub->get_option("--out-unit")->check(OneOf({"m", "cm", "mm", "in"}));
  sub->get_option("--rename")->take_all();
  AddReadOptions(sub, options->read);
  registry.Add(sub, "calib convert", [options](CommandContext&) { return Describe(stages::RunCalibConvert(*options)); });
}

}  // namespace mvstudio::cli
