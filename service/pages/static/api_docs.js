// Starts Swagger UI, which its own script has put into the window, over our description of the API.

const viewer = document.getElementById("viewer");

window.SwaggerUIBundle({
  domNode: viewer,
  url: viewer.dataset.description,
  deepLinking: true,
  docExpansion: "list",
  // Else it asks a public host for a badge.
  validatorUrl: null,
});
