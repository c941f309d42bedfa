#include "cli/program/commands.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "stages/tradeoff/describe.h"

namespace mvstudio::cli {

void RegisterTradeoffTriangulate(CLI::App& tradeoff, Registry& registry) {
  const auto options = std::make_shared<stages::TriangulateTradeoffOptions>();
  CLI::App* sub = tradeoff.add_subcommand(
      "triangulate",
      "Method x precision x number of views x threads: points a second, left-out px, mm, coverage, and the Pareto front");
  AddPoseArguments(sub, options->pose);
  StartGroup(sub, "Ways");
  AddChoices(sub, "--methods", options->methods, "to compare")->delimiter(',')->capture_default_str();
  AddOption(sub, "--precisions", options->precisions, "double, float; float for robust, all-views, linear and midpoint")
      ->delimiter(',')
      ->capture_default_str();
  AddOption(sub, "--views", options->views, "views a point uses at most; 0: all")->delimiter(',')->capture_default_str();
  AddOption(sub, "--threads-list", options->threads, "numbers of threads")->delimiter(',')->capture_default_str();
  StartGroup(sub, "Truth");
  AddOption(sub, "--truth", options->truth, "a folder of body3DScene files, or points as `markers convert` takes them");
  AddOption(sub, "--marker-unit", options->marker_unit,
            "m, cm, mm, in or the length of one unit, e.g. 25mm: of a file of markers, instead of what it states");
  AddFlag(sub, "--align-truth", options->align_truth, "take out the best rigid motion before comparing with --truth");
  StartGroup(sub, "Detections");
  AddOption(sub, "--sigma-px", options->take.sigma_px, "px; standard deviation of a detection; 0 estimates it")
      ->capture_default_str();
  AddOption(sub, "--min-score", options->take.min_score, "0..1; detections with a lower score are left out")
      ->capture_default_str();
  AddOption(sub, "--max-persons", options->take.max_persons, "the best supported persons of the take are kept")
      ->capture_default_str();
  StartGroup(sub, "Output");
  AddOutput(sub, "--out", options->out, OutputKind::kFolder, "folder for the table and the figure");
  registry.Add(sub, "tradeoff triangulate",
               [options](CommandContext& context) { return Describe(stages::RunTriangulateTradeoff(*options, context.run)); });
}

}  // namespace mvstudio::cli
