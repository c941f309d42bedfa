#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/disk/files.h"
#include "core/error.h"
#include "report/compare/compared.h"
#include "report/page/format.h"
#include "report/page/slider.h"

/// Held-out images of two runs, of the same camera and frame.
namespace mvstudio::report {
namespace {

namespace fs = std::filesystem;

struct ImagePair {
  std::string name, caption;
  double gain;  ///< of the SSIM; NaN: not stated
};

const Value& EntryOfImage(const Stage& stage, const std::string& name) {
  static const Value null;
  for (const Value& image : stage.metrics()["pictures"].items()) {
    if (fs::path(image["path"].Text()).filename() == name) return image;
  }
  return null;
}

std::string BytesOf(const Value& image) {
  try {
    return image.IsNull() ? "" : ReadFile(image["path"].Text());
  } catch (const Error&) {
    return "";
  }
}

/// The same camera, frame and true image in both, whatever the protocols are.
bool IsShared(const SectionContext& context, const Stage& first, const Stage& last, const std::string& name) {
  const Value &a = EntryOfImage(first, name), &b = EntryOfImage(last, name);
  if (a["camera"].Text() != b["camera"].Text() || a["frame"].Number() != b["frame"].Number()) return false;
  if (ImageOfEval(context, first, "render", name).IsNull() || ImageOfEval(context, last, "render", name).IsNull()) return false;
  const std::string truth = BytesOf(ImageOfEval(context, first, "truth", name));
  return !truth.empty() && truth == BytesOf(ImageOfEval(context, last, "truth", name));
}

/// Those that lost most first.
std::vector<ImagePair> SharedPairs(const SectionContext& context, const Stage& first, const Stage& last) {
  std::vector<ImagePair> pairs;
  for (const Value& image : last.metrics()["pictures"].items()) {
    const std::string name = fs::path(image["path"].Text()).filename().string();
    if (name.empty() || !IsShared(context, first, last, name)) continue;
    const double gain = image["ssim"].Number() - EntryOfImage(first, name)["ssim"].Number();
    std::string caption = "camera " + image["camera"].Text() + ", frame " + FormatNumber(image["frame"].Number(), 9);
    if (std::isfinite(gain)) caption += gain == 0 ? ", the same SSIM" : ", SSIM " + SignedText(gain);
    pairs.push_back({name, caption, gain});
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const ImagePair& a, const ImagePair& b) {
    return std::isfinite(a.gain) && (!std::isfinite(b.gain) || a.gain < b.gain);
  });
  return pairs;
}

std::string SsimCaption(const std::string& run, const Stage& stage, const std::string& name) {
  const double ssim = EntryOfImage(stage, name)["ssim"].Number();
  return run + (std::isfinite(ssim) ? ", SSIM " + FormatFixed(ssim, 3) : "");
}

std::string PairHtml(SectionContext* context, const ComparedRuns& runs, const ComparedStage& stage, const ImagePair& pair) {
  const Stage &first = *stage.runs.front(), &last = *stage.runs.back();
  const std::string before = EmbedOutput(context, first, ImageOfEval(*context, first, "render", pair.name),
                                         SsimCaption(runs.names.front(), first, pair.name));
  const std::string after = EmbedOutput(context, last, ImageOfEval(*context, last, "render", pair.name),
                                        SsimCaption(runs.names.back(), last, pair.name));
  if (before.empty() || after.empty()) return {};
  const std::string truth = EmbedOutput(context, first, ImageOfEval(*context, first, "truth", pair.name), "truth");
  NeedScript(context, SliderScript());
  return "<div>" + ParagraphHtml(pair.caption, "muted") + "<div class=\"beside\" data-left=\"" +
         EscapeHtml(runs.names.front()) + "\" data-right=\"" + EscapeHtml(runs.names.back()) + "\">" +
         GridHtml({before, after, truth}, "grid methods") + "</div></div>\n";
}

}  // namespace

std::string ImagePairs(SectionContext* context, const ComparedRuns& runs, const std::vector<ComparedStage>& stages) {
  constexpr int kMostOpen = 4;
  std::vector<std::string> shown, folded;
  int count = 0;
  for (const ComparedStage& stage : stages) {
    if (stage.command != "avatar eval" || !stage.InBoth()) continue;
    for (const ImagePair& pair : SharedPairs(*context, *stage.runs.front(), *stage.runs.back())) {
      if (count >= context->options.max_heldout_images) break;
      const std::string html = PairHtml(context, runs, stage, pair);
      if (html.empty()) continue;
      (++count <= kMostOpen ? shown : folded).push_back(html);
    }
  }
  if (shown.empty()) return "";
  const std::string more = folded.empty() ? "" : DetailsHtml(std::to_string(folded.size()) + " more images", GridHtml(folded));
  return ParagraphHtml("The same camera and frame in both runs, what lost most first. The slider moves the border between " +
                           runs.names.front() + " (left) and " + runs.names.back() + " (right).",
                       "muted") +
         GridHtml(shown) + more;
}

}  // namespace mvstudio::report
