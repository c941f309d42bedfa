#include <algorithm>
#include <charconv>

#include "core/disk/manifest.h"
#include "core/error.h"
#include "core/format.h"
#include "core/utf8.h"

namespace mvstudio {
namespace {

constexpr char kSchema[] = "mvstudio.manifest/1";

/// A JSON string. File names may hold any bytes: those that are no UTF-8 become lone surrogates, U+DC80 to U+DCFF, as in
/// Python's `surrogateescape` (PEP 383).
std::string Quoted(std::string_view text) {
  std::string out = "\"";
  for (size_t at = 0; at < text.size();) {
    const size_t length = Utf8Length(text, at);
    const auto byte = static_cast<unsigned char>(text[at]);
    if (length == 0 || byte < 0x20 || byte == 0x7f) {
      out += Format("\\u%04x", length == 0 ? 0xdc00 + byte : byte);
    } else {
      if (byte == '"' || byte == '\\') out += '\\';
      out.append(text, at, length);
    }
    at += length == 0 ? 1 : length;
  }
  return out + '"';
}

std::string DigestText(const FileDigest& digest) {
  return "\"size\": " + std::to_string(digest.size) + ", \"sha256\": " + Quoted(digest.sha256);
}

/// Reads the layout that ManifestToJsonText writes, character by character.
class Reader {
 public:
  Reader(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  /// Takes the words, with any white space before each of them.
  void Expect(std::string_view word) {
    if (!Accept(word)) Fail("expected `" + std::string(word) + "`");
  }
  bool Accept(std::string_view word) {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\r')) ++at_;
    if (text_.compare(at_, word.size(), word) != 0) return false;
    at_ += word.size();
    return true;
  }
  std::string Text() {
    Expect("\"");
    std::string out;
    while (at_ < text_.size() && text_[at_] != '"') out += Character();
    if (at_ >= text_.size()) Fail("a text does not end");
    ++at_;
    return out;
  }
  uint64_t Number() {
    Accept("");
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) Fail("expected a number");
    at_ = static_cast<size_t>(end - text_.data());
    return value;
  }
  void End() {
    Accept("");
    if (at_ != text_.size()) Fail("goes on after its end");
  }
  [[noreturn]] void Fail(const std::string& what) const {
    throw FormatError(path_, "byte " + std::to_string(at_), what + "; the file is damaged or not ours, move it elsewhere");
  }

 private:
  char Character() {
    const char c = text_[at_++];
    if (c != '\\') return c;
    if (at_ >= text_.size()) Fail("a text does not end");
    const char kind = text_[at_++];
    if (kind == '"' || kind == '\\') return kind;
    unsigned code = 0;
    if (kind != 'u' || text_.size() - at_ < 4) Fail("unknown escape");
    const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + at_ + 4, code, 16);
    const bool control = code < 0x20 || code == 0x7f, byte = code >= 0xdc80 && code <= 0xdcff;
    if (error != std::errc() || end != text_.data() + at_ + 4 || (!control && !byte)) Fail("unknown escape");
    at_ += 4;
    return static_cast<char>(code & 0xff);
  }

  std::string_view text_;
  const std::string& path_;
  size_t at_ = 0;
};

FileDigest ReadDigest(Reader& in) {
  FileDigest digest;
  in.Expect("\"size\":");
  digest.size = in.Number();
  in.Expect(",");
  in.Expect("\"sha256\":");
  digest.sha256 = in.Text();
  const bool hex = digest.sha256.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (digest.sha256.size() != 64 || !hex) in.Fail("`" + digest.sha256 + "` is no SHA-256");
  return digest;
}

/// A name that can only lie inside the folder; one of a folder ends in a slash.
bool IsInside(const std::string& path) {
  if (path.empty() || path.find('\0') != std::string::npos) return false;
  for (size_t begin = 0; begin < path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const std::string part = path.substr(begin, end - begin);
    if (part.empty() || part == "." || part == "..") return false;
    begin = end + 1;
  }
  return true;
}

void ReadEntry(Reader& in, Manifest* manifest) {
  in.Expect("{");
  in.Expect("\"path\":");
  const std::string path = in.Text();
  if (!IsInside(path)) in.Fail("`" + path + "` is no name inside the folder");
  ManifestEntry entry;
  if (path.back() != '/') {
    in.Expect(",");
    entry.now = ReadDigest(in);
    if (in.Accept(", \"by\":")) entry.by = in.Text();
    if (in.Accept(", \"before\":")) {
      in.Expect("{");
      entry.before = ReadDigest(in);
      in.Expect("}");
    }
  }
  in.Expect("}");
  manifest->files[path] = entry;
}

}  // namespace

std::string ManifestToJsonText(const Manifest& manifest) {
  std::string text = "{\"schema\": \"" + std::string(kSchema) + "\",\n \"state\": \"" +
                     (manifest.whole ? "whole" : "unfinished") + "\",\n \"command\": " + Quoted(manifest.command) +
                     ",\n \"version\": " + Quoted(manifest.version) + ",\n \"files\": [";
  const char* separator = "\n";
  for (const auto& [path, entry] : manifest.files) {
    text += separator + std::string("  {\"path\": ") + Quoted(path);
    if (path.back() != '/') text += ", " + DigestText(entry.now);
    if (!entry.by.empty()) text += ", \"by\": " + Quoted(entry.by);
    if (entry.before) text += ", \"before\": {" + DigestText(*entry.before) + "}";
    text += "}";
    separator = ",\n";
  }
  return text + "\n ]}\n";
}

Manifest ManifestFromJsonText(std::string_view text, const std::string& path) {
  Reader in(text, path);
  Manifest manifest;
  in.Expect("{");
  in.Expect("\"schema\":");
  if (in.Text() != kSchema) in.Fail("the schema is not " + std::string(kSchema));
  in.Expect(",");
  in.Expect("\"state\":");
  const std::string state = in.Text();
  if (state != "whole" && state != "unfinished") in.Fail("unknown state");
  manifest.whole = state == "whole";
  in.Expect(",");
  in.Expect("\"command\":");
  manifest.command = in.Text();
  in.Expect(",");
  in.Expect("\"version\":");
  manifest.version = in.Text();
  in.Expect(",");
  in.Expect("\"files\":");
  in.Expect("[");
  if (!in.Accept("]")) {
    do {
      ReadEntry(in, &manifest);
    } while (in.Accept(","));
    in.Expect("]");
  }
  in.Expect("}");
  in.End();
  return manifest;
}

}  // namespace mvstudio
