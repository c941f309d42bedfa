#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <set>

#include "report/page/format.h"
#include "report/sections.h"

/// Images that results list, with captions in words.
namespace mvstudio::report {
namespace {

std::set<std::string> CameraNames(const Value& metrics) {
  std::set<std::string> names;
  for (const char* key : {"per_camera", "cameras", "holdout_cameras"}) {
    for (const Value& item : metrics[key].items())
      names.insert(item.IsText() ? item.Text() : item["camera"].Text(item["name"].Text()));
  }
  names.erase("");
  return names;
}

/// What the result says of an image beyond its path: its entry in the metrics, of the same file name.
const Value& ImageEntry(const Value& metrics, const std::string& path) {
  static const Value null;
  const auto name = std::filesystem::path(path).filename();
  for (const Value& entry : metrics["pictures"].items()) {
    if (std::filesystem::path(entry["path"].Text()).filename() == name) return entry;
  }
  return null;
}

/// Trailing digits of a file name as a frame number; NaN when there are none.
double FrameInName(const std::string& stem, const std::string& camera) {
  const size_t at = camera.empty() ? std::string::npos : stem.find(camera);
  const std::string rest = at == std::string::npos ? stem : stem.substr(at + camera.size());
  const size_t before = rest.find_last_not_of("0123456789");
  const std::string digits = before == std::string::npos ? rest : rest.substr(before + 1);
  return digits.empty() || digits.size() > 12 ? std::numeric_limits<double>::quiet_NaN() : std::stod(digits);
}

/// "camera cam_02, frame 84, SSIM 0.93, PSNR 24.1 dB", from what the result says of the image, else from its file name.
std::string Caption(const Value& metrics, const Value& output, const std::string& of_no_camera) {
  const std::string path = output["path"].Text(), stem = std::filesystem::path(path).stem().string();
  const Value& entry = ImageEntry(metrics, path);
  std::string camera = output["camera"].Text(entry["camera"].Text());
  for (const std::string& name : CameraNames(metrics)) {
    if (camera.empty() && stem.find(name) != std::string::npos) camera = name;
  }
  if (camera.empty()) return of_no_camera.empty() ? WordsOf(stem) : of_no_camera;
  const double frame = output["frame"].Number(entry["frame"].Number(FrameInName(stem, camera)));
  std::string caption = "camera " + camera + (std::isfinite(frame) ? ", frame " + FormatNumber(frame, 9) : "");
  if (entry["ssim"].IsNumber()) caption += ", SSIM " + FormatFixed(entry["ssim"].Number(), 3);
  if (entry["psnr_db"].IsNumber()) caption += ", PSNR " + FormatFixed(entry["psnr_db"].Number(), 1) + "\u00a0dB";
  return caption;
}

/// Outputs of a role; those with the lowest SSIM first, those without one last.
std::vector<Value> OutputsOf(const Stage& stage, const std::string& role) {
  std::vector<std::pair<double, Value>> found;
  for (const Value& output : stage.result["outputs"].items()) {
    if (output["role"].Text() != role) continue;
    found.emplace_back(ImageEntry(stage.metrics(), output["path"].Text())["ssim"].Number(), output);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) {
    return std::isfinite(a.first) && (!std::isfinite(b.first) || a.first < b.first);
  });
  std::vector<Value> outputs;
  for (auto& [ssim, output] : found) outputs.push_back(std::move(output));
  return outputs;
}

}  // namespace

std::string WordsOf(const std::string& file_name) {
  std::string words = file_name.substr(0, file_name.find('.'));
  std::replace(words.begin(), words.end(), '_', ' ');
  return words;
}

std::string ImagesOf(SectionContext* context, const Stage& stage, const ImageRole& role) {
  constexpr size_t kMostOpen = 4;
  std::vector<std::string> shown, folded;
  int left_out = 0;
  for (const Value& output : OutputsOf(stage, role.name)) {
    if (static_cast<int>(shown.size() + folded.size()) >= context->options.max_heldout_images) {
      ++left_out;
      continue;
    }
    const std::string figure =
        EmbedOutput(context, stage, output, Caption(stage.metrics(), output, role.caption), role.legend, role.compared);
    if (!figure.empty()) (shown.size() < kMostOpen ? shown : folded).push_back(figure);
  }
  if (shown.empty()) return {};
  const char* grid = role.compared ? "grid images" : "grid";
  std::string html = (role.title.empty() ? "" : "<h3>" + EscapeHtml(role.title) + "</h3>\n") + GridHtml(shown, grid);
  if (!folded.empty()) {
    html += DetailsHtml(std::to_string(folded.size()) + (folded.size() == 1 ? " more image" : " more images"),
                        GridHtml(folded, grid));
  }
  if (left_out > 0)
    html += ParagraphHtml(
        std::to_string(left_out) + " more are listed in the result; option 'max-heldout-pictures' shows more.", "muted");
  return html;
}

Section HeldOutSection(SectionContext* context) {
  Section section{"heldout", "Held-out images", ""};
  const std::vector<const Stage*> stages = context->data.All("avatar eval");
  for (const Stage* stage : stages) {
    const std::string images =
        ImagesOf(context, *stage, {"heldout-picture", "", {"truth", "render", "error", "nearest pose"}, true});
    if (images.empty()) continue;
    if (stages.size() > 1 && !ForClient(context->options)) section.body_html += StageHeading(context->data, *stage);
    section.body_html += images;
  }
  if (!section.body_html.empty()) {
    section.body_html =
        ParagraphHtml("Not trained on, the worst first. The slider moves the border between the true image and the avatar's.",
                      "muted") +
        section.body_html;
  }
  return section;
}

}  // namespace mvstudio::report
