#include "stages/board/describe.h"

#include <algorithm>
#include <cmath>

#include "core/format.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;

ordered_json TagCornersJson(const Eigen::Matrix<double, 2, 4>& px) {
  ordered_json json = ordered_json::array();
  for (int k = 0; k < 4; ++k) {
    const auto rounded = [](double value) {
      return std::isfinite(value) ? ordered_json(std::round(value * 1e4) / 1e4) : ordered_json();
    };
    json.push_back({rounded(px(0, k)), rounded(px(1, k))});
  }
  return json;
}

ordered_json BoardTrialJson(const calib::BoardTrial& trial, bool scale_known) {
  ordered_json json;
  json["board"] = calib::BoardText(trial.board, scale_known);
  json["relation"] = trial.relation;
  json["mirrored"] = trial.mirrored;
  json["num_images"] = trial.num_images;
  json["num_corners"] = trial.num_corners;
  json["residual_px"] = trial.num_images > 0 ? ordered_json(trial.residual_px) : ordered_json();
  return json;
}

std::string BoardTrialsText(const calib::BoardCheckReport& report) {
  constexpr size_t kMaxLines = 12;
  std::string text = "images  corners  residual px  board\n";
  size_t shown = 0;
  for (const calib::BoardTrial& trial : report.trials) {
    if (shown >= kMaxLines && trial.num_images == 0) break;
    ++shown;
    const std::string residual = trial.num_images > 0 ? Format("%.3f", trial.residual_px) : "-";
    text += Format("%3d/%-3d %7d  %11s  %s  (%s)\n", trial.num_images, report.num_images, trial.num_corners, residual.c_str(),
                   calib::BoardText(trial.board, report.scale_known).c_str(), trial.relation.c_str());
  }
  if (shown < report.trials.size()) text += Format("%zu more that fit no image\n", report.trials.size() - shown);
  return text;
}

std::string TagsText(const calib::BoardCheckReport& report, const std::vector<std::string>& labels) {
  std::string text;
  for (const calib::SeenTag& tag : report.tags) {
    text += Format("%s  tag %s:%d", labels[tag.image].c_str(), tag.family.c_str(), tag.id);
    for (int k = 0; k < 4; ++k) text += Format("  (%.2f %.2f)", tag.px(0, k), tag.px(1, k));
    text += "\n";
  }
  return text + Format("%zu tags in %d images\n", report.tags.size(), report.num_images);
}

/// What is known of a board that could not be told.
std::string KnownText(const std::vector<calib::SeenMarkers>& seen) {
  const auto most =
      std::max_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) { return a.num_ids < b.num_ids; });
  if (most == seen.end()) return "the board must be sharp and flat; a chessboard must be visible as a whole";
  return Format(
      "%d markers of %s were seen (ids %d to %d, in %d images), too few in one image or in no known layout: show all "
      "of the board, near and sharp, or write it down with option 'board'; single markers of one side are option 'board' "
      "tag:%s:%d-%d:SIDE",
      most->num_ids, most->dictionary.c_str(), most->smallest_id, most->largest_id, most->num_images, most->dictionary.c_str(),
      most->smallest_id, most->largest_id);
}

CommandResult DescribeBoardFound(const calib::BoardCheckReport& report) {
  CommandResult result;
  result.metrics["board"] = ordered_json();
  if (!report.best) {
    if (!report.tags.empty()) {
      result.warnings.push_back({"BRD-NO-BOARD", "tags were found, but not as one board",
                                 "a tag that is seen more than once in an image cannot be distinguished from its copies"});
      return result;
    }
    result.exit = kExitBadInput;
    result.errors.push_back({"BRD-NONE", "no board that was tried is in any of the images", KnownText(report.markers)});
    return result;
  }
  const calib::BoardTrial& best = report.trials[*report.best];
  const std::string text = calib::BoardText(best.board, report.scale_known);
  result.metrics["board"] = text;
  result.metrics["mirrored"] = best.mirrored;
  if (best.mirrored) {
    result.warnings.push_back({"BRD-MIRRORED", "the images are mirrored: the board can be read only in a mirror",
                               "switch the mirroring of the camera off, or flip the images"});
  }
  if (best.num_images < report.num_images) {
    result.warnings.push_back({"BRD-PARTLY", Format("found in %d of %d images", best.num_images, report.num_images),
                               "hidden, blurred or too small in the others"});
  }
  result.text += Format("%d of %d images, %d corners, residual %.3f px: %s\n", best.num_images, report.num_images,
                        best.num_corners, best.residual_px, best.relation.c_str());
  result.text += "option 'board' " + text + (report.scale_known ? "" : "   (measure the length and put it in)") + "\n";
  return result;
}

ordered_json ProposalJson(const calib::BoardProposal& proposal) {
  return {{"board", calib::ToString(proposal.board)},
          {"suits", proposal.Suits()},
          {"print_mm", {1e3 * proposal.width_m, 1e3 * proposal.height_m}},
          {"near_m", proposal.near_m},
          {"far_m", proposal.far_m}};
}

}  // namespace

CommandResult Describe(const BoardDrawn& drawn) {
  CommandResult result;
  result.metrics["board"] = calib::ToString(drawn.board);
  result.metrics["page_mm"] = {drawn.page.width, drawn.page.height};
  result.metrics["num_corners"] = drawn.board.num_corners();
  result.outputs.push_back({drawn.out, "board"});
  result.text = Format("%s: %s on a page of %.1f x %.1f mm; print at 100 %% and check the ruler\n", drawn.out.c_str(),
                       calib::ToString(drawn.board).c_str(), drawn.page.width, drawn.page.height);
  return result;
}

CommandResult Describe(const BoardSearched& searched) {
  const calib::BoardCheckReport& report = searched.check;
  CommandResult result;
  result.inputs = searched.inputs;
  result.metrics["num_images"] = report.num_images;
  result.metrics["trials"] = ordered_json::array();
  for (const calib::BoardTrial& trial : report.trials)
    result.metrics["trials"].push_back(BoardTrialJson(trial, report.scale_known));
  result.metrics["num_tags"] = report.tags.size();
  result.metrics["tags"] = ordered_json::array();
  for (const calib::SeenTag& tag : report.tags) {
    ordered_json json = {{"image", searched.labels[tag.image]}, {"family", tag.family}, {"id", tag.id}, {"border", tag.border}};
    json["corners_px"] = TagCornersJson(tag.px);
    json["refined_px"] = TagCornersJson(tag.refined_px);
    result.metrics["tags"].push_back(json);
  }
  if (!report.tags.empty()) result.text = TagsText(report, searched.labels);
  result.text += BoardTrialsText(report);
  result.Add(DescribeBoardFound(report));
  return result;
}

CommandResult Describe(const BoardsProposed& proposed) {
  const calib::ProposeOptions& options = proposed.options;
  CommandResult result;
  result.metrics["boards"] = ordered_json::array();
  result.text = Format("%-34s %-13s distance m\n", "board", "print mm");
  for (const calib::BoardProposal& proposal : proposed.boards) {
    result.metrics["boards"].push_back(ProposalJson(proposal));
    const std::string distances = proposal.Suits() ? Format("%.2f to %.2f", proposal.near_m, proposal.far_m)
                                                   : Format("none; images of %d px or more, or fewer squares",
                                                            LeastImageWidthPx(proposal, options.image_width_px));
    result.text += Format("%-34s %3.0f x %-7.0f %s\n", calib::ToString(proposal.board).c_str(), 1e3 * proposal.width_m,
                          1e3 * proposal.height_m, distances.c_str());
  }
  result.text += Format(
      "for images %d px wide with a field of view of %g degrees; board draw BOARD option 'paper' %s option 'out' board.pdf "
      "prints one\n",
      options.image_width_px, options.fov_deg, std::string(calib::ToString(options.paper)).c_str());
  return result;
}

}  // namespace mvstudio::stages
