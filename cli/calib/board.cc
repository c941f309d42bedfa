#include <algorithm>
#include <cmath>
#include <memory>

#include "calib/board/draw.h"
#include "calib/board/propose.h"
#include "calib/detect/board_check.h"
#include "cli/program/arguments.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/frames.h"

namespace mvstudio::cli {
namespace {

using nlohmann::ordered_json;

struct DrawArguments {
  std::string board, out;
  calib::BoardDrawOptions options;
};

struct CheckArguments {
  std::vector<std::string> images;
  std::string board;
  int max_images = 30;
};

CommandResult RunDraw(const DrawArguments& arguments) {
  const calib::Board board = calib::ParseBoard(arguments.board);
  const OutputFiles place({arguments.out}, {});
  calib::WriteBoardPage(board, arguments.out, arguments.options);
  const calib::BoardPage page = calib::LayOutBoard(board, arguments.options);
  CommandResult result;
  result.metrics["board"] = calib::ToString(board);
  result.metrics["page_mm"] = {page.width, page.height};
  result.metrics["num_corners"] = board.num_corners();
  result.outputs.push_back({arguments.out, "board"});
  result.text = Format("%s: %s on a page of %.1f x %.1f mm; print at 100 %% and check the ruler\n", arguments.out.c_str(),
                       calib::ToString(board).c_str(), page.width, page.height);
  return result;
}

/// At most `max_images` frames of every source, evenly spread, with their labels.
std::vector<Image> ReadImages(const CheckArguments& arguments, std::vector<std::string>* labels) {
  if (arguments.max_images < 1) throw UsageError("--max-images must be 1 or more");
  std::vector<Image> images;
  const int64_t share = std::max<int64_t>(1, arguments.max_images / static_cast<int64_t>(arguments.images.size()));
  for (const std::string& path : arguments.images) {
    const auto source = dataset::OpenFrames(path, {false, true, true});
    const int64_t stride = std::max<int64_t>(1, (source->num_frames() + share - 1) / share);
    int64_t position = 0;
    for (int64_t taken = 0; taken < share; ++position) {
      auto frame = source->Next();
      if (!frame) break;
      if (position % stride != 0) continue;
      images.push_back(std::move(frame->rgb));
      labels->push_back(frame->label);
      ++taken;
    }
  }
  if (images.empty()) throw FormatError(arguments.images.front(), "", "holds no image");
  return images;
}

ordered_json PointsJson(const Eigen::Matrix<double, 2, 4>& px) {
  ordered_json json = ordered_json::array();
  for (int k = 0; k < 4; ++k) {
    const auto rounded = [](double value) {
      return std::isfinite(value) ? ordered_json(std::round(value * 1e4) / 1e4) : ordered_json();
    };
    json.push_back({rounded(px(0, k)), rounded(px(1, k))});
  }
  return json;
}

ordered_json TrialJson(const calib::BoardTrial& trial, bool scale_known) {
  ordered_json json;
  json["board"] = calib::BoardText(trial.board, scale_known);
  json["relation"] = trial.relation;
  json["mirrored"] = trial.mirrored;
  json["num_images"] = trial.num_images;
  json["num_corners"] = trial.num_corners;
  json["residual_px"] = trial.num_images > 0 ? ordered_json(trial.residual_px) : ordered_json();
  return json;
}

std::string TrialsText(const calib::BoardCheckReport& report) {
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
      "of the board, near and sharp, or write it down with --board; single markers of one side are --board tag:%s:%d-%d:SIDE",
      most->num_ids, most->dictionary.c_str(), most->smallest_id, most->largest_id, most->num_images, most->dictionary.c_str(),
      most->smallest_id, most->largest_id);
}

void AddVerdict(const calib::BoardCheckReport& report, CommandResult* result) {
  result->metrics["board"] = ordered_json();
  if (!report.best) {
    if (!report.tags.empty()) {
      result->warnings.push_back({"BRD-NO-BOARD", "tags were found, but not as one board",
                                  "a tag that is seen more than once in an image cannot be distinguished from its copies"});
      return;
    }
    result->exit = kExitBadInput;
    result->errors.push_back({"BRD-NONE", "no board that was tried is in any of the images", KnownText(report.markers)});
    return;
  }
  const calib::BoardTrial& best = report.trials[*report.best];
  const std::string text = calib::BoardText(best.board, report.scale_known);
  result->metrics["board"] = text;
  result->metrics["mirrored"] = best.mirrored;
  if (best.mirrored) {
    result->warnings.push_back({"BRD-MIRRORED", "the images are mirrored: the board can be read only in a mirror",
                                "switch the mirroring of the camera off, or flip the images"});
  }
  if (best.num_images < report.num_images) {
    result->warnings.push_back({"BRD-PARTLY", Format("found in %d of %d images", best.num_images, report.num_images),
                                "hidden, blurred or too small in the others"});
  }
  result->text += Format("%d of %d images, %d corners, residual %.3f px: %s\n", best.num_images, report.num_images,
                         best.num_corners, best.residual_px, best.relation.c_str());
  result->text += "--board " + text + (report.scale_known ? "" : "   (measure the length and put it in)") + "\n";
}

CommandResult RunCheck(const CheckArguments& arguments, CommandContext& context) {
  std::optional<calib::Board> given;
  if (!arguments.board.empty()) given = calib::ParseBoard(arguments.board);
  if (given && (given->kind == calib::Board::Kind::kGrid || given->kind == calib::Board::Kind::kPoints)) {
    throw UsageError("board " + arguments.board + " is for corner files and cannot be searched in images");
  }
  std::vector<std::string> labels;
  const std::vector<Image> images = ReadImages(arguments, &labels);
  const calib::BoardCheckReport report = calib::CheckBoard(given, images, context.run);
  CommandResult result;
  result.inputs = arguments.images;
  result.metrics["num_images"] = report.num_images;
  result.metrics["trials"] = ordered_json::array();
  for (const calib::BoardTrial& trial : report.trials) result.metrics["trials"].push_back(TrialJson(trial, report.scale_known));
  result.metrics["num_tags"] = report.tags.size();
  result.metrics["tags"] = ordered_json::array();
  for (const calib::SeenTag& tag : report.tags) {
    ordered_json json = {{"image", labels[tag.image]}, {"family", tag.family}, {"id", tag.id}, {"border", tag.border}};
    json["corners_px"] = PointsJson(tag.px);
    json["refined_px"] = PointsJson(tag.refined_px);
    result.metrics["tags"].push_back(json);
  }
  if (!report.tags.empty()) result.text += TagsText(report, labels);
  result.text += TrialsText(report);
  AddVerdict(report, &result);
  return result;
}

ordered_json ProposalJson(const calib::BoardProposal& proposal) {
  return {{"board", calib::ToString(proposal.board)},
          {"suits", proposal.Suits()},
          {"print_mm", {1e3 * proposal.width_m, 1e3 * proposal.height_m}},
          {"near_m", proposal.near_m},
          {"far_m", proposal.far_m}};
}

CommandResult RunPropose(const calib::ProposeOptions& options) {
  CommandResult result;
  result.metrics["boards"] = ordered_json::array();
  result.text = Format("%-34s %-13s distance m\n", "board", "print mm");
  for (const calib::BoardProposal& proposal : calib::ProposeBoards(options)) {
    result.metrics["boards"].push_back(ProposalJson(proposal));
    const std::string distances = proposal.Suits() ? Format("%.2f to %.2f", proposal.near_m, proposal.far_m)
                                                   : Format("none; images of %d px or more, or fewer squares",
                                                            LeastImageWidthPx(proposal, options.image_width_px));
    result.text += Format("%-34s %3.0f x %-7.0f %s\n", calib::ToString(proposal.board).c_str(), 1e3 * proposal.width_m,
                          1e3 * proposal.height_m, distances.c_str());
  }
  result.text += Format(
      "for images %d px wide with a field of view of %g degrees; board draw BOARD --paper %s --out board.pdf prints one\n",
      options.image_width_px, options.fov_deg, std::string(calib::ToString(options.paper)).c_str());
  return result;
}

void RegisterPropose(CLI::App& board, Registry& registry) {
  const auto options = std::make_shared<calib::ProposeOptions>();
  CLI::App* sub = board.add_subcommand("propose", "Boards that fit the paper, and the distances that they suit");
  AddOptions(sub, *options);
  sub->get_option("--paper")->check(OneOf({"a4", "a3", "a2", "a1", "letter"}));  // none has no size to fill
  registry.Add(sub, "board propose", [options](CommandContext&) { return RunPropose(*options); });
}

void RegisterDraw(CLI::App& board, Registry& registry) {
  const auto arguments = std::make_shared<DrawArguments>();
  CLI::App* sub = board.add_subcommand("draw", "Write a board as PDF, SVG or PNG at true scale");
  AddOption(sub, "BOARD", arguments->board, calib::kBoardForms)->required();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "file to write: .pdf, .svg or .png")->required();
  AddOptions(sub, arguments->options);
  registry.Add(sub, "board draw", [arguments](CommandContext&) { return RunDraw(*arguments); });
}

void RegisterCheck(CLI::App& board, Registry& registry) {
  const auto arguments = std::make_shared<CheckArguments>();
  CLI::App* sub = board.add_subcommand("check", "Find out which board is in the images, and how to write it");
  AddOption(sub, "IMAGES", arguments->images, "images, folders, patterns in quotes, or videos")->required();
  AddOption(sub, "--board", arguments->board,
            "the expected board; lengths are taken from it. Without it every kind is searched for");
  AddOption(sub, "--max-images", arguments->max_images, "maximum number of images to search")->capture_default_str();
  registry.Add(sub, "board check", [arguments](CommandContext& context) { return RunCheck(*arguments, context); });
}

}  // namespace

void RegisterBoard(CLI::App& app, Registry& registry) {
  CLI::App* board = app.add_subcommand("board", "Propose and draw calibration boards, find out which one is in the images");
  board->require_subcommand(1);
  RegisterPropose(*board, registry);
  RegisterDraw(*board, registry);
  RegisterCheck(*board, registry);
}

}  // namespace mvstudio::cli
