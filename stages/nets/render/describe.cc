#include "stages/nets/render/describe.h"

#include <cmath>
#include <set>
#include <sstream>

#include "core/format.h"
#include "stages/frame_notice.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

nlohmann::ordered_json RenderMetrics(const AvatarRenderReport& report) {
  const avatar::RenderPlan& plan = report.plan;
  const avatar::RenderOptions& asked = report.options.render;
  std::set<std::string> views;
  for (const avatar::RenderJob& job : plan.jobs) views.insert(job.view);
  nlohmann::ordered_json m;
  m["pictures"] = plan.jobs.size();
  m["views"] = views;
  m["poses"] = {{"source", plan.track.source}, {"number", plan.track.poses.size()}};
  m["scale"] = {{"normalised", plan.scaled}, {"trained_over_given", plan.ratio}};
  m["size_px"] = asked.size_px > 0 ? asked.size_px : report.trained_size_px;
  if (report.method != avatar::Method::kGaussians)
    m["network_size_px"] = asked.network_size_px > 0 ? asked.network_size_px : report.trained_size_px;
  m["frame"] = ToString(asked.frame);
  m["rate_hz"] = report.rate_hz;
  m["method"] = ToString(report.method);
  m["checkpoint_step"] = report.checkpoint_step;
  m["seconds_per_picture"] = FiniteOrNull(report.seconds / static_cast<double>(plan.jobs.size()));
  return m;
}

CommandResult RenderWarnings(const AvatarRenderReport& report) {
  CommandResult result;
  const avatar::RenderPlan& plan = report.plan;
  if (!plan.skipped.empty()) {
    result.exit = kExitPartial;
    result.warnings.push_back(
        {"AVA-SKIPPED", std::to_string(plan.skipped.size()) + " images could not be made; the first: " + plan.skipped.front(),
         "leave these cameras or frames out, or use option 'place' training"});
  }
  NoteFrames(plan.track.beyond, &result);
  constexpr double kSameSize = 0.05;
  if (plan.foreign && !plan.scaled && std::abs(plan.ratio - 1) > kSameSize) {
    const std::string text =
        Format("the poses' bones are %.3g times the trained person's, which the network never saw", 1 / plan.ratio);
    result.warnings.push_back({"AVA-SCALE", text, "render with option 'scale-normalise' on"});
  }
  if (report.method == avatar::Method::kV2v && report.options.render.turntable > 0) {
    result.warnings.push_back({"AVA-V2V-MOVING-CAMERA",
                               "v2v uses the previous image and was trained with cameras that do not move",
                               "expect trails, or turn with an avatar of method tna"});
  }
  return result;
}

}  // namespace

CommandResult Describe(const AvatarRenderReport& report) {
  CommandResult result;
  static_cast<InputNotes&>(result) = report.notes;
  const avatar::RenderPlan& plan = report.plan;
  result.folder = report.options.run_folder, result.outputs = report.outputs;
  result.inputs = {report.options.run_folder, report.dataset};
  for (const std::string& input : {report.options.render.calib, report.options.render.poses, report.options.render.bvh}) {
    if (!input.empty()) result.inputs.push_back(input);
  }
  result.metrics = RenderMetrics(report);
  result.Add(RenderWarnings(report));
  std::ostringstream text;
  text << Counted(static_cast<int64_t>(plan.jobs.size()), "image") << " of "
       << Counted(static_cast<int64_t>(result.metrics["views"].size()), "view") << ", "
       << Counted(static_cast<int64_t>(plan.track.poses.size()), "pose") << " of " << plan.track.source;
  if (plan.scaled) text << " in the trained person's size (x " << plan.ratio << ")";
  text << Format(", %.3f s an image\n", report.seconds / static_cast<double>(plan.jobs.size()));
  if (!result.outputs.empty()) text << "  " << result.outputs.front().path << (result.outputs.size() > 1 ? " …\n" : "\n");
  result.text = text.str();
  return result;
}

}  // namespace mvstudio::stages
