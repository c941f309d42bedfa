#include <algorithm>

#include "report/page/image.h"
#include "report/sections.h"

namespace mvstudio::report {
namespace {

bool IsMp4(std::string_view bytes) { return bytes.size() > 12 && bytes.substr(4, 4) == "ftyp"; }

std::string EmbedVideo(SectionContext* context, const Stage& stage, const Value& output) {
  const std::string content = ReadOutput(context, stage, output, IsMp4, "no .mp4");
  if (content.empty()) return {};
  const std::string path = output["path"].Text();
  return FigureHtml("<video controls loop muted src=\"data:video/mp4;base64," + Base64(content) + "\"></video>",
                    "The avatar in motion: " + WordsOf(path.substr(path.rfind('/') + 1)));
}

/// A few images of a turn or of a new camera, evenly over all of them.
std::string RenderedImages(SectionContext* context, const Stage& stage) {
  constexpr size_t kMost = 8;
  std::vector<const Value*> all;
  for (const Value& output : stage.result["outputs"].items()) {
    if (output["role"].Text() == "rendered-picture") all.push_back(&output);
  }
  std::vector<std::string> figures;
  for (size_t i = 0; i < std::min(kMost, all.size()); ++i) {
    const Value& output = *all[i * all.size() / std::min(kMost, all.size())];
    const std::string path = output["path"].Text();
    figures.push_back(EmbedOutput(context, stage, output, WordsOf(path.substr(path.rfind('/') + 1))));
  }
  return figures.empty() ? "" : GridHtml(figures, "grid methods");
}

}  // namespace

Section PreviewSection(SectionContext* context) {
  Section section{"preview", "Preview", ""};
  for (const Stage& stage : context->data.stages) {
    const std::string before = section.body_html;
    for (const Value& output : stage.result["outputs"].items()) {
      const std::string role = output["role"].Text();
      if (role == "video") section.body_html += EmbedVideo(context, stage, output);
      if (role == "gaussians-player" && ForClient(context->options)) section.body_html += EmbedPlayer(context, stage, output);
    }
    if (section.body_html == before) section.body_html += RenderedImages(context, stage);
  }
  return section;
}

}  // namespace mvstudio::report
