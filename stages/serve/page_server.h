#pragma once

#include <functional>
#include <memory>
#include <string>

namespace mvstudio::stages {

struct PageRequest {
  std::string method;  ///< "GET" (of HEAD, too) or "POST"
  std::string path;    ///< what stands behind the token: "", "scene.json", "image/0.jpg"
  std::string body;
};

struct PageAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::string policy = {};  ///< Content-Security-Policy; empty: the page's own files alone
};

/// Shows a page to somebody: each request has its answer, until `ended` is true.
using ShowPage =
    std::function<void(const std::function<PageAnswer(const PageRequest&)>& answer, const std::function<bool()>& ended)>;

/// A page for the browser of this machine: HTTP on 127.0.0.1 alone. Only addresses below a random token are answered, and
/// only to requests that name this server as their host and, where they say so, as their origin (RFC 6454), so that pages of
/// other sites cannot ask. A request has at most 1 MiB and 20 s, its header 8 KiB; of too many connections the oldest are
/// closed. Nothing of the disk is served but what `answer` returns. One thread.
class PageServer {
 public:
  using Answer = std::function<PageAnswer(const PageRequest&)>;

  /// `port` 0: any that is free. Errors of input thrown by `answer` become status 400, others 500, with their text. Throws
  /// ResourceError when the port is taken.
  PageServer(int port, Answer answer);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  const std::string& url() const;
  /// Until `stop` returns true; it is asked about ten times a second.
  void Run(const std::function<bool()>& stop);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mvstudio::stages
