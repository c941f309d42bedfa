#include "cli/program/redact.h"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <climits>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <set>

namespace mvstudio::cli {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

bool IsLonger(const std::string& a, const std::string& b) { return a.size() != b.size() ? a.size() > b.size() : a < b; }

struct Identity {
  std::vector<std::string> here, homes;                              // folders, without a slash at the end
  std::vector<std::string> users, hosts;                             // names
  std::set<std::string, decltype(&IsLonger)> known_paths{IsLonger};  // absolute, the longest first
};

std::optional<Identity>& Own() {
  static std::optional<Identity> identity;
  return identity;
}

void AddFolder(const std::string& path, std::vector<std::string>* folders) {
  std::string folder = path;
  while (!folder.empty() && folder.back() == '/') folder.pop_back();
  if (!folder.empty() && folder[0] == '/') folders->push_back(folder);
}

void AddName(const char* name, std::vector<std::string>* names) {
  if (name && *name) names->push_back(name);
}

std::string Environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

/// Where a path begins in an argument: "NAME=/a/b", "/a/b".
std::string PathIn(const std::string& word) {
  const size_t start = !word.empty() && word[0] == '/' ? 0 : word.find("=/");
  if (start == std::string::npos) return "";
  return word.substr(word[start] == '=' ? start + 1 : start);
}

void KnowPath(const std::string& word, Identity* identity) {
  const std::string path = PathIn(word);
  if (path.size() > 1 && path.find('\n') == std::string::npos) identity->known_paths.insert(path);
}

void KnowPathsIn(const Json& json, Identity* identity) {
  if (json.is_string()) KnowPath(json.get<std::string>(), identity);
  if (json.is_structured()) {
    for (const Json& item : json) KnowPathsIn(item, identity);
  }
}

Identity FindIdentity(const std::vector<std::string>& argv) {
  Identity found;
  std::error_code ignored;
  AddFolder(fs::current_path(ignored).string(), &found.here);
  AddFolder(Environment("PWD"), &found.here);
  AddFolder(Environment("HOME"), &found.homes);
  AddName(Environment("USER").c_str(), &found.users);
  AddName(Environment("LOGNAME").c_str(), &found.users);
  if (const passwd* entry = getpwuid(getuid())) {
    AddFolder(entry->pw_dir, &found.homes);
    AddName(entry->pw_name, &found.users);
  }
  char host[HOST_NAME_MAX + 1] = "";
  if (gethostname(host, sizeof(host) - 1) == 0) {
    AddName(host, &found.hosts);
    const std::string name = host;
    AddName(name.substr(0, name.find('.')).c_str(), &found.hosts);
  }
  for (const std::string& word : argv) KnowPath(word, &found);
  return found;
}

/// What stands below `folder`: empty when `path` is the folder itself; nothing when it lies elsewhere.
std::optional<std::string> Below(const std::string& path, const std::string& folder) {
  if (path == folder) return "";
  if (path.size() > folder.size() && path.compare(0, folder.size(), folder) == 0 && path[folder.size()] == '/')
    return path.substr(folder.size() + 1);
  return std::nullopt;
}

std::string ShortPath(const std::string& path) {
  for (const std::string& folder : Own()->here) {
    if (const auto rest = Below(path, folder)) return rest->empty() ? "." : *rest;
  }
  for (const std::string& folder : Own()->homes) {
    if (const auto rest = Below(path, folder)) return rest->empty() ? "~" : "~/" + *rest;
  }
  size_t end = path.size();
  while (end > 1 && path[end - 1] == '/') --end;
  if (end <= 1) return path;
  const size_t slash = path.rfind('/', end - 1);
  return "…" + path.substr(slash);
}

bool IsWordByte(char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; }

/// Every `word` that is no part of a longer one.
std::string ReplaceWord(std::string text, const std::string& word, const std::string& by) {
  for (size_t at = text.find(word); at != std::string::npos;) {
    const size_t end = at + word.size();
    const bool whole = (at == 0 || !IsWordByte(text[at - 1])) && (end == text.size() || !IsWordByte(text[end]));
    if (whole) text.replace(at, word.size(), by);
    at = text.find(word, whole ? at + by.size() : end);
  }
  return text;
}

bool BeginsPath(const std::string& text, size_t at) {
  if (text[at] != '/' || at + 1 == text.size()) return false;
  if (!IsWordByte(text[at + 1]) && text[at + 1] != '.' && static_cast<unsigned char>(text[at + 1]) < 0x80) return false;
  return at == 0 || std::string(" \t\n\"'`(=,:[{;<|").find(text[at - 1]) != std::string::npos;
}

size_t EndOfPath(const std::string& text, size_t at) {
  for (; at < text.size(); ++at) {
    if (std::string(" \t\n\"'`)],;>|").find(text[at]) != std::string::npos) return at;
    if (text[at] == ':' && (at + 1 == text.size() || text[at + 1] == ' ')) return at;
  }
  return at;
}

/// Paths given as arguments by their full length; others end where a word does.
std::string ReplacePaths(const std::string& text) {
  std::string result;
  for (size_t at = 0; at < text.size();) {
    if (!BeginsPath(text, at)) {
      result += text[at++];
      continue;
    }
    size_t end = EndOfPath(text, at);
    for (const std::string& known : Own()->known_paths) {
      if (text.compare(at, known.size(), known) == 0) {
        end = std::max(end, EndOfPath(text, at + known.size()));
        break;
      }
    }
    result += ShortPath(text.substr(at, end - at));
    at = end;
  }
  return result;
}

/// A text that is nothing but a path, or NAME=PATH, may hold spaces.
std::string ShortenPaths(const std::string& text) {
  const std::string path = PathIn(text);
  const std::string head = text.substr(0, text.size() - path.size());
  const bool alone = path.size() > 1 && path.find(": ") == std::string::npos && head.find(' ') == std::string::npos;
  return alone ? head + ShortPath(path) : ReplacePaths(text);
}

}  // namespace

void StartRedacting(const std::vector<std::string>& argv) { Own() = FindIdentity(argv); }

void KnowPaths(const Json& json) {
  if (Redacting()) KnowPathsIn(json, &*Own());
}

bool Redacting() { return Own().has_value(); }

std::string Redacted(const std::string& text) {
  if (!Redacting()) return text;
  std::string result = ShortenPaths(text);
  for (const std::string& name : Own()->users) result = ReplaceWord(std::move(result), name, "user");
  for (const std::string& name : Own()->hosts) result = ReplaceWord(std::move(result), name, "host");
  return result;
}

Json RedactedJson(Json json) {
  if (!Redacting()) return json;
  if (json.is_string()) return Redacted(json.get<std::string>());
  if (json.is_array()) {
    for (Json& item : json) item = RedactedJson(std::move(item));
  }
  if (!json.is_object()) return json;
  Json result = Json::object();
  for (auto& [key, value] : json.items()) {
    const bool fixed =
        key == "schema" || key == "command" || key == "code" || key == "status" || key == "version" || key == "role";
    result[BeginsPath(key, 0) ? Redacted(key) : key] = fixed ? value : RedactedJson(value);
  }
  return result;
}

}  // namespace mvstudio::cli
