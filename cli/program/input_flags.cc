#include "cli/program/input_flags.h"

#include "cli/program/arguments.h"
#include "cli/program/options.h"
#include "core/join.h"

namespace mvstudio::cli {

void AddReadOptions(CLI::App* sub, stages::CalibReadOptions& options) {
  AddChoice(sub, "--from", options.from, "format of the input: auto, " + calib::CalibrationFormatNames())
      ->capture_default_str()
      ->type_name("FORMAT")
      ->check(OneOf(stages::CalibrationFormatChoices()));
  AddChoice(sub, "--size", options.size, "WIDTHxHEIGHT px: image size where the file does not give it");
  AddChoice(sub, "--unit", options.unit, "unit of length of files that name none: m, cm, mm or in")
      ->capture_default_str()
      ->check(OneOf({"m", "cm", "mm", "in"}));
  AddOption(sub, "--frame-rate", options.frame_rate_hz,
            "Hz, of the cameras: kalibr's time shifts become time offsets in frames; they are left out, and said, unless given")
      ->check(CLI::PositiveNumber);
  AddOption(sub, "--qca-distortion-divisor", options.qca_distortion_divisor,
            "qca: the distortion is divided by this when read, multiplied when written (1: coefficients as they stand; 64: as "
            "Pose2Sim does)")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  AddMeaningOptions(sub, options);
}

void AddMeaningOptions(CLI::App* sub, stages::CalibReadOptions& options) {
  AddChoice(sub, "--lens", options.lens,
            "auto, perspective or fisheye: of files that do not say it (opencv, easymocap, nerfstudio, toml)")
      ->capture_default_str();
  AddFlag(sub, "--invert", options.invert, stages::kInvertHelp);
  AddFlag(sub, "--mirror", options.mirror, stages::kMirrorHelp);
  AddOption(
      sub, "--allow-approximation", options.allow_approximation_px,
      "px; the nearest lens takes the place of one that cannot be kept: when reading one with skew, when writing one that the "
      "format lacks. Refused where a pixel of the image moves farther")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
}

void AddPoseArguments(CLI::App* sub, stages::PoseArguments& arguments) {
  AddOptions(sub, arguments);
  sub->get_option("--calib")->required();
}

}  // namespace mvstudio::cli
