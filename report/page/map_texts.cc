#include <algorithm>
#include <array>

#include "report/page/html.h"

namespace mvstudio::report {
namespace {

constexpr std::array<std::pair<std::string_view, char>, 5> kEntities = {
    {{"&amp;", '&'}, {"&lt;", '<'}, {"&gt;", '>'}, {"&quot;", '"'}, {"&#39;", '\''}}};

/// The inverse of EscapeHtml.
std::string Unescaped(std::string_view html) {
  std::string text;
  for (size_t at = 0; at < html.size();) {
    const auto found = std::find_if(kEntities.begin(), kEntities.end(),
                                    [&](const auto& entity) { return html.substr(at, entity.first.size()) == entity.first; });
    text += found == kEntities.end() ? html[at] : found->second;
    at += found == kEntities.end() ? 1 : found->first.size();
  }
  return text;
}

/// Behind the `>` of the tag that begins at `at`.
size_t EndOfTag(std::string_view html, size_t at) {
  for (bool quoted = false; at < html.size(); ++at) {
    if (html[at] == '"') quoted = !quoted;
    if (html[at] == '>' && !quoted) return at + 1;
  }
  return at;
}

/// Texts of attributes that people read.
std::string MapAttributes(std::string tag, const TextMap& map) {
  for (const std::string_view name : {" alt=\"", " aria-label=\""}) {
    const size_t found = tag.find(name), begin = found + name.size();
    const size_t end = found == std::string::npos ? found : tag.find('"', begin);
    if (end != std::string::npos)
      tag.replace(begin, end - begin, EscapeHtml(map(Unescaped(std::string_view(tag).substr(begin, end - begin)))));
  }
  return tag;
}

}  // namespace

std::string MapTexts(std::string_view html, const TextMap& map) {
  std::string mapped;
  for (size_t at = 0; at < html.size();) {
    const size_t tag = std::min(html.find('<', at), html.size());
    if (tag > at) mapped += EscapeHtml(map(Unescaped(html.substr(at, tag - at))));
    at = EndOfTag(html, tag);
    mapped += MapAttributes(std::string(html.substr(tag, at - tag)), map);
    for (const std::string_view raw : {"script", "style"}) {
      if (html.substr(std::min(tag + 1, html.size()), raw.size()) != raw) continue;
      const size_t end = std::min(html.find("</" + std::string(raw), at), html.size());
      mapped += html.substr(at, end - at);
      at = end;
    }
  }
  return mapped;
}

}  // namespace mvstudio::report
