#include "dataset/session/session.h"
#include "tests/fuzz/fuzz.h"

/// mvstudio.toml and names of cameras and takes.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(session_toml, bytes) {
  const std::string folder = ScratchFolder("session");
  Scratch("session/mvstudio.toml", bytes);
  dataset::Session session;
  if (!Accepts([&] { session = dataset::ReadSession(folder); })) return;
  const std::string text = dataset::SessionText(session);
  Scratch("session/mvstudio.toml", text);
  dataset::Session back;
  Require(Accepts([&] { back = dataset::ReadSession(folder); }), "what was written cannot be read");
  Require(dataset::SessionText(back) == text, "the session changes when it is read and written again");
}

/// A slug is a plain file name whatever the name, and different names have different slugs.
MVS_FUZZ_TARGET(slug, bytes) {
  const auto parts = Parts(bytes, 2);
  if (parts[0].empty() || parts[1].empty()) return;
  const std::string slug = dataset::Slug(std::string(parts[0]));
  Require(!slug.empty() && slug.size() <= 80 && slug[0] != '-' && slug[0] != '.', "a slug that is no plain name: " + slug);
  const bool plain =
      slug.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-") == std::string::npos;
  Require(plain, "a slug with other characters");
  Require(dataset::Slug(slug) == slug, "the slug of a slug is another");
  Require(parts[0] == parts[1] || dataset::Slug(std::string(parts[1])) != slug, "two names have one slug");
}

}  // namespace mvstudio::fuzz
