-- Opens a graph, waits for diagnostics, completes a wire and renames a block; writes what it saw.
-- Environment: SERVER (a JSON list), GRAPH (the file), RESULT (where to write).
local seen = {}
local function finish()
  local file = assert(io.open(vim.env.RESULT, "w"))
  file:write(vim.fn.json_encode(seen))
  file:close()
  vim.cmd("qall!")
end

local done, problem = pcall(function()
  vim.cmd("edit " .. vim.fn.fnameescape(vim.env.GRAPH))
  local buffer = vim.api.nvim_get_current_buf()
  local id = vim.lsp.start_client({
    name = "spikeblocks",
    cmd = vim.fn.json_decode(vim.env.SERVER),
    root_dir = vim.fn.fnamemodify(vim.env.GRAPH, ":h"),
  })
  vim.lsp.buf_attach_client(buffer, id)
  local client = vim.lsp.get_client_by_id(id)
  assert(vim.wait(90000, function() return client.initialized end, 20), "no answer to initialize")
  assert(vim.wait(90000, function() return #vim.diagnostic.get(buffer) > 0 end, 20), "no diagnostics")
  seen.diagnostics = vim.tbl_map(function(d) return d.message end, vim.diagnostic.get(buffer))

  local function at(text, back)
    vim.api.nvim_win_set_cursor(0, { 1, 0 })
    vim.fn.search("\\V" .. text, "ceW")
    local cursor = vim.api.nvim_win_get_cursor(0)
    vim.api.nvim_win_set_cursor(0, { cursor[1], cursor[2] - back })
    return vim.lsp.util.make_position_params(0, client.offset_encoding)
  end
  local function ask(method, params)
    local answer = vim.lsp.buf_request_sync(buffer, method, params, 90000)
    return assert(answer and answer[id] and answer[id].result, "no answer to " .. method)
  end

  -- The character after 'gain: ' of the marked wire.
  local place = at("b: {input: a", 0)
  seen.labels = vim.tbl_map(function(i) return i.label end, ask("textDocument/completion", place).items)
  local params = at("b: {type", 7)
  params.newName = "twice"
  vim.lsp.util.apply_workspace_edit(ask("textDocument/rename", params), client.offset_encoding)
  seen.lines = vim.api.nvim_buf_get_lines(buffer, 0, -1, false)
end)
if not done then seen.error = tostring(problem) end
finish()
